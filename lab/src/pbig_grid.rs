//! PBIG's grid on the CPU (Lo et al. 2013, 4.2 and 4.3): the plain scalar twin of the GPU kernels.
//!
//! Every box has an entry in each cell that it touches, and pairs are tested within a cell.
//! A cell of few boxes is tested through Avril's mapping from indices to pairs, a larger one by PBIG's balanced rows. A pair
//! that meets in several cells is reported by its owner: the component-wise maximum of the lowest cells of its boxes. The
//! paper calls this cell the "corner of the intersection with the largest coordinates". It is an integer here, so it is
//! exact (contract 3).

use pbig_core::{Aabb, Checks, Error, Limits, Pair};
use pbig_gpu::GpuOptions;
use pbig_gpu::pbig::{Summary, cells_along, cells_in, density_cell, ordinary, pbig_cell, space_of};
use pbig_harness::pair_index::{pair_count, pair_of, row_len, row_pair};

/// Maximum number of cells per box. With more cells, empty cells cost more than full ones.
const MAX_CELLS_PER_BOX: f64 = 4.0;

/// Maximum number of cells that a box may touch. A box that touches more is tested against all others.
const MAX_TOUCHED_CELLS: u64 = 512;

/// The rule that turns [`GpuOptions::boxes_per_cell`] into a cell size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CellRule {
    /// PBIG's equation 6: the smallest cell with that many entries on average.
    Objective,
    /// Avril's section 4.1: the cell that holds this number of boxes at the density of the space. Sizes do not matter.
    Density,
}

/// The grid of [`pbig_grid`]: one entry for each cell that a box touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PbigPlan {
    /// Edge of the cubic cells, in the boxes' length unit.
    pub(crate) cell: f32,
    /// Lower corner of cell 0, in the boxes' length unit.
    pub(crate) origin: [f32; 3],
    /// Number of cells on each axis. Boxes beyond are clamped into the border cells.
    pub(crate) dims: [u32; 3],
}

impl PbigPlan {
    /// Plans the grid for the boxes behind `summary`, with the cell size by the rule and [`GpuOptions::boxes_per_cell`].
    pub(crate) fn new(summary: &Summary, options: &GpuOptions, rule: CellRule) -> Self {
        let sample = ordinary(summary);
        let (space, origin) = space_of(summary, &sample);
        let (n, wanted) = (summary.valid, options.boxes_per_cell.max(1.0));
        let mut cell = match rule {
            CellRule::Objective => pbig_cell(&sample, n, space, wanted),
            CellRule::Density => density_cell(n, space, wanted),
        };
        // Oversize boxes in the sample raise alpha, and with it f, at any cell size. Equation 6 would then have a billion
        // cells for a handful of boxes.
        while cells_in(space, cell) > f64::from(n.max(64)) * MAX_CELLS_PER_BOX {
            cell *= 1.25;
        }
        Self { cell, origin, dims: space.map(|length| cells_along(length, cell) as u32) }
    }

    /// Returns the key of a cell.
    fn key(&self, [x, y, z]: [u32; 3]) -> usize {
        ((z * self.dims[1] + y) * self.dims[0] + x) as usize
    }
}

/// The result of [`pbig_grid`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PbigFound {
    /// All overlapping pairs, sorted.
    pub(crate) pairs: Vec<Pair>,
    /// Tests made, counted as in the paper's section 4.1.
    pub(crate) checks: Checks,
    /// The grid.
    pub(crate) plan: PbigPlan,
}

/// Finds all overlapping pairs with PBIG's grid, on one thread.
///
/// It uses the options `boxes_per_cell` and `small_cell`.
///
/// # Errors
/// [`Error::TooManyBoxes`] and [`Error::TooManyPairs`], by [`Limits::DEFAULT`].
pub(crate) fn pbig_grid(boxes: &[Aabb], options: &GpuOptions, rule: CellRule) -> Result<PbigFound, Error> {
    let limit = Limits::DEFAULT.max_boxes;
    if boxes.len() as u64 > limit {
        return Err(Error::TooManyBoxes { boxes: boxes.len() as u64, limit });
    }
    let plan = PbigPlan::new(&Summary::of(boxes), options, rule);
    let grid = PbigGrid::new(&plan, boxes);
    let mut found = PbigFound { pairs: Vec::new(), checks: Checks::default(), plan };
    for key in 0..grid.offsets.len() - 1 {
        found.check_cell(&grid, key, options.small_cell);
        found.check_limit()?;
    }
    for (i, one) in grid.oversize.iter().enumerate() {
        grid.oversize[i + 1..].iter().chain(&grid.members).for_each(|other| found.test(one, other));
        found.check_limit()?;
    }
    found.pairs.sort_unstable();
    Ok(found)
}

/// Number of boxes of a segment, whose places are a byte each (PBIG 5.2).
const SEGMENT: u32 = 256;

/// Returns the words of all pairs as the paper's records, which name a cell, a segment and a place. Pairs of oversize boxes are left out.
pub(crate) fn record_words(boxes: &[Aabb], options: &GpuOptions) -> u64 {
    let plan = PbigPlan::new(&Summary::of(boxes), options, CellRule::Objective);
    let grid = PbigGrid::new(&plan, boxes);
    (0..grid.offsets.len() - 1).map(|key| words_of_cell(&grid.hits(&plan, key))).sum()
}

/// Returns the words of a cell's pairs as records, or as a list if that takes fewer. Cell and segments take three words; a row
/// takes a byte for its place, one for the number of its partners, and one for each.
fn words_of_cell(hits: &[(u32, u32)]) -> u64 {
    let mut rows: Vec<_> = hits.iter().map(|(i, j)| ([i / SEGMENT, j / SEGMENT], *i)).collect();
    rows.sort_unstable();
    let words = |row: &[([u32; 2], u32)]| (row.len() as u64 + 2).div_ceil(4);
    let of_rows: u64 = rows.chunk_by(|a, b| a == b).map(words).sum();
    let records = rows.chunk_by(|a, b| a.0 == b.0).count() as u64;
    (3 * records + of_rows).min(1 + 2 * hits.len() as u64)
}

/// A box with the cells that it touches, both ends included.
#[derive(Clone, Copy, Debug)]
struct GridMember {
    aabb: Aabb,
    id: u32,
    low: [u32; 3],
    high: [u32; 3],
}

impl GridMember {
    fn new(plan: &PbigPlan, id: u32, aabb: Aabb) -> Self {
        let cell = |k: usize, x: f32| {
            let scaled = (x - plan.origin[k]) * (1.0 / plan.cell);
            scaled.clamp(0.0, (plan.dims[k] - 1) as f32) as u32
        };
        let [low, high] = [aabb.min, aabb.max].map(|corner| std::array::from_fn(|k| cell(k, corner[k])));
        Self { aabb, id, low, high }
    }

    /// Returns the number of cells.
    fn count(&self) -> u64 {
        (0..3).map(|k| u64::from(self.high[k] - self.low[k] + 1)).product()
    }

    /// Returns the keys of the cells, row by row.
    fn keys(self, plan: &PbigPlan) -> impl Iterator<Item = usize> {
        let [[x, y, z], [to_x, to_y, to_z]] = [self.low, self.high];
        (z..=to_z)
            .flat_map(move |z| (y..=to_y).flat_map(move |y| (x..=to_x).map(move |x| plan.key([x, y, z]))))
    }
}

/// The grid: for each cell a range of `entries`, each an index into `members`.
#[derive(Debug)]
struct PbigGrid {
    offsets: Vec<u32>,
    entries: Vec<u32>,
    members: Vec<GridMember>,
    /// Boxes that touch too many cells, which are tested against all others.
    oversize: Vec<GridMember>,
}

impl PbigGrid {
    /// Builds the grid by count, scan and scatter: the three kernels of PBIG 4.2.
    fn new(plan: &PbigPlan, boxes: &[Aabb]) -> Self {
        let (members, oversize) = select(plan, boxes);
        let mut offsets = vec![0; plan.dims.iter().product::<u32>() as usize + 1];
        for key in members.iter().flat_map(|member| member.keys(plan)) {
            offsets[key] += 1;
        }
        let mut sum = 0;
        for offset in &mut offsets {
            sum += *offset;
            *offset = sum;
        }
        let mut entries = vec![0; sum as usize];
        for (i, member) in members.iter().enumerate().rev() {
            for key in member.keys(plan) {
                offsets[key] -= 1;
                entries[offsets[key] as usize] = i as u32;
            }
        }
        Self { offsets, entries, members, oversize }
    }

    /// Returns the entries of a cell.
    fn cell(&self, key: usize) -> &[u32] {
        &self.entries[self.offsets[key] as usize..self.offsets[key + 1] as usize]
    }

    /// Returns the pairs that a cell owns, by the places of their boxes in it.
    fn hits(&self, plan: &PbigPlan, key: usize) -> Vec<(u32, u32)> {
        let member = |place: u32| &self.members[self.cell(key)[place as usize] as usize];
        let is_hit = |&(i, j): &(u32, u32)| {
            let (a, b) = (member(i), member(j));
            owner(plan, a, b) == key && a.aabb.overlaps(&b.aabb)
        };
        let n = self.cell(key).len() as u32;
        (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).filter(is_hit).collect()
    }
}

/// Returns the key of the cell that reports a pair.
fn owner(plan: &PbigPlan, a: &GridMember, b: &GridMember) -> usize {
    plan.key(std::array::from_fn(|k| a.low[k].max(b.low[k])))
}

/// Returns the valid boxes with their cells, and the oversize boxes.
fn select(plan: &PbigPlan, boxes: &[Aabb]) -> (Vec<GridMember>, Vec<GridMember>) {
    let valid = (0..).zip(boxes).filter(|(_, aabb)| aabb.is_valid());
    let mut entries = 0;
    valid.map(|(id, aabb)| GridMember::new(plan, id, *aabb)).partition(|member| {
        let count = member.count();
        // Entries are counted in 32 bits.
        let fits = count <= MAX_TOUCHED_CELLS && entries + count <= u64::from(u32::MAX);
        entries += if fits { count } else { 0 };
        fits
    })
}

impl PbigFound {
    /// Tests the pairs of a cell.
    fn check_cell(&mut self, grid: &PbigGrid, key: usize, small_cell: u32) {
        let entries = grid.cell(key);
        let n = entries.len() as u32;
        let mut check = |i, j| self.check_in_cell(grid, key, entries[i as usize], entries[j as usize]);
        if n <= small_cell {
            let pairs = (0..pair_count(n.into())).map(|k| pair_of(k, n.into()));
            pairs.for_each(|(i, j)| check(i as u32, j as u32));
        } else {
            let pairs = (0..n).flat_map(|row| (0..row_len(row, n)).map(move |k| row_pair(row, k, n)));
            pairs.for_each(|(i, j)| check(i, j));
        }
    }

    /// Tests two members in a cell that both touch, if it is the owner of their pair.
    fn check_in_cell(&mut self, grid: &PbigGrid, key: usize, i: u32, j: u32) {
        let (a, b) = (&grid.members[i as usize], &grid.members[j as usize]);
        if owner(&self.plan, a, b) == key {
            self.test(a, b);
        } else {
            self.checks.made += 1;
            self.checks.redundant += 1;
        }
    }

    fn test(&mut self, a: &GridMember, b: &GridMember) {
        self.checks.made += 1;
        if a.aabb.overlaps(&b.aabb) {
            self.pairs.push(Pair::new(a.id, b.id));
        } else {
            self.checks.unnecessary += 1;
        }
    }

    fn check_limit(&self) -> Result<(), Error> {
        let limit = Limits::DEFAULT.max_pairs;
        if self.pairs.len() as u64 > limit { Err(Error::TooManyPairs { limit }) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;
    use pbig_gpu::pbig::pbig_objective;
    use pbig_harness::corpus::corpus;

    fn boxes() -> Vec<Aabb> {
        let at = |i: u32| [i * 37 % 101, i * 53 % 29, i * 17 % 7].map(|x| x as f32 * 0.7);
        let mut boxes: Vec<_> =
            (0..600).map(|i| Aabb::from_center(at(i), [0.2 + (i % 5) as f32; 3])).collect();
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        boxes.push(Aabb::new([-1e6, -1.0, -1e6], [1e6, 0.0, 1e6]));
        boxes.push(Aabb::NOWHERE);
        boxes
    }

    /// Compares the pairs and the counts of tests with the oracle, for all options.
    fn check(boxes: &[Aabb], name: &str) {
        let wanted = oracle::pairs(boxes);
        for rule in [CellRule::Objective, CellRule::Density] {
            for (boxes_per_cell, small_cell) in [(1.0, 32), (4.0, 1), (32.0, 0), (4.0, u32::MAX)] {
                let options = GpuOptions { boxes_per_cell, small_cell, ..GpuOptions::DEFAULT };
                let found = pbig_grid(boxes, &options, rule).expect("few boxes");
                assert_eq!(found.pairs, wanted, "{name}, {rule:?}, {boxes_per_cell}, {small_cell}");
                let Checks { made, unnecessary, redundant, .. } = found.checks;
                assert_eq!(made, unnecessary + redundant + wanted.len() as u64, "{name}, {:?}", found.plan);
            }
        }
    }

    #[test]
    fn the_pairs_are_those_of_the_oracle_for_all_options() {
        check(&boxes(), "a ground under boxes");
        corpus().iter().for_each(|case| check(&case.boxes, &case.name));
    }

    #[test]
    fn a_ground_under_a_pile_does_not_enlarge_the_cells() {
        let at = |i: u32| [i % 10, i / 10 % 10, i / 100].map(|c| c as f32 * 2.0);
        let mut boxes: Vec<Aabb> = (0..999).map(|i| Aabb::from_center(at(i), [0.5; 3])).collect();
        for half in [1e3, 1e6, 0.5 * f32::MAX] {
            boxes.push(Aabb::from_center([0.0; 3], [half; 3]));
            let plan = PbigPlan::new(&Summary::of(&boxes), &GpuOptions::DEFAULT, CellRule::Objective);
            assert!(plan.cell < 10.0, "ground of {half}: {plan:?}");
        }
    }

    fn cubes(n: usize, edge: f32) -> Vec<Aabb> {
        vec![Aabb::new([0.0; 3], [edge; 3]); n]
    }

    #[test]
    fn records_by_hand() {
        // One pair as a list; two rows of two and one partners; a row whose partners lie in two segments.
        assert_eq!(words_of_cell(&[(0, 1)]), 3);
        assert_eq!(words_of_cell(&[(0, 1), (0, 2), (1, 2)]), 3 + 1 + 1);
        let row: Vec<_> = (1..300).map(|j| (0, j)).collect();
        assert_eq!(words_of_cell(&row), 3 + 257u64.div_ceil(4) + 3 + 46u64.div_ceil(4));
    }

    #[test]
    fn records_take_a_byte_a_pair_in_a_crowd_and_more_than_a_list_elsewhere() {
        let bytes_a_pair = |boxes: &[Aabb]| {
            let pairs = oracle::pairs(boxes).len() as f64;
            4.0 * record_words(boxes, &GpuOptions::DEFAULT) as f64 / pairs
        };
        let site = |i: u32| [i % 2, i / 2 % 2, i / 4 % 2].map(|x| 100.0 * x as f32);
        let crowd: Vec<_> = (0..8 * 300).map(|i| Aabb::from_center(site(i), [1.0; 3])).collect();
        let crowd = bytes_a_pair(&crowd);
        assert!((1.0..1.1).contains(&crowd), "{crowd}");
        let place = |i: u32| [i / 2 % 8, i / 16 % 8, i / 128].map(|x| 4.0 * x as f32);
        let couples: Vec<_> = (0..1024).map(|i| Aabb::from_center(place(i), [1.0; 3])).collect();
        assert!(bytes_a_pair(&couples) > 8.0, "{}", bytes_a_pair(&couples));
    }

    #[test]
    fn objective_by_hand() {
        // 10^3 boxes of edge 15 in 100^3, cells of 10: M = 1000, alpha = 2^3, f = 8.
        assert_eq!(pbig_objective(&cubes(10, 15.0), 1000, [100.0; 3], 10.0), 8.0);
    }

    #[test]
    fn the_constraint_holds_and_a_smaller_cell_would_break_it() {
        let (sample, space) = (cubes(1000, 50.0), [1e4; 3]);
        for wanted in [2.0, 8.0, 32.0] {
            let cell = pbig_cell(&sample, 1_000_000, space, wanted);
            let f = |cell| pbig_objective(&sample, 1_000_000, space, cell);
            assert!(f(cell) >= wanted && f(cell * 0.98) < wanted, "W = {wanted}: cell {cell}");
        }
    }

    #[test]
    fn density_rule_puts_the_wanted_boxes_into_a_cell_that_fits() {
        let cell = density_cell(1_000_000, [1000.0; 3], 8.0);
        assert!((cell - 20.0).abs() < 1e-3, "{cell}");
        assert_eq!(density_cell(1, [10.0, 5.0, 5.0], 1e9), 10.0);
    }
}
