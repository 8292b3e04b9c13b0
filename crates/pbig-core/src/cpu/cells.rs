//! Cells: from coordinates to integers, once (contract 3), and from those to keys and codes.
//!
//! A coordinate becomes a number of *steps*, [`STEPS`] to a cell, by one monotone function; the cell is that number
//! without its lowest bits. The grid has no bounds (contract 4). A cell is three integers `x, y, z`; its *key* is
//! `(x + y * dims.x + z * dims.x * dims.y) mod M`, `M` a power of two. Neighbours in x are neighbours in memory, a row
//! of a window is one run of entries, and what lies outside the planned range wraps onto other cells, which costs
//! tests but never a pair:
//!
//! * A box is stored once, so no pair is found in two cells.
//! * Two cells of a window never share a key: `dims.x >= 8`, `dims.y >= 8`, `M >= 8 dims.x dims.y`, and windows reach
//!   one cell to each side (or are checked against `dims`). So a pair is met at most once from each of its boxes, and
//!   from exactly one of them, because the half neighbourhood and its mirror image share no key either.
//! * Lower corners of two boxes that overlap are at most an extent apart, which is at most `STEPS - 2` steps before
//!   rounding and `STEPS` after: one cell. Windows of other boxes are computed from coordinates that bound those of
//!   every overlapping box: whatever the rounding, it is inside.
//!
//! The *code* of a box is its steps in 64 bits: six fields of ten, of which nine are used, `-lo` on each axis and above
//! them `hi`, modulo 512. With the halves of one code exchanged the sum of two is `hi - lo` of either box against the
//! other, and the ninth bit of a field is set where that is negative: where the boxes are apart. So one addition and one
//! test tell whether two boxes may overlap, and where they do they say so, as long as the extents of the two add up to
//! less than 256 steps.

use crate::Aabb;
use crate::plan::LevelPlan;

/// Steps to a cell, as a power of two.
const STEP_BITS: u32 = 6;

/// Steps to a cell.
const STEPS: i64 = 1 << STEP_BITS;

/// Coordinates beyond this many steps from the origin share the last one: 2^40 cells. In f64 rounding up to here is
/// less than a twentieth of a step.
const FARTHEST: f64 = (1u64 << 46) as f64;

/// Floats near this one are integers.
const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// Bits of a field of a code that are used.
const FIELD: u64 = 511;

/// Where the lowest bit of each field of a half is.
const SHIFTS: [u32; 3] = [0, 10, 20];

/// The bits of the sum of two codes that are set where boxes are apart.
pub(super) const APART: u64 = 0x1004_0100_1004_0100;

/// From coordinates to steps, cells, keys and codes, for one level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    origin: [f64; 3],
    steps: [f64; 3],
    max_extent: [f64; 3],
    /// Steps from the lower side of a cell within which boxes of the cell below reach into it.
    reach: [u32; 3],
    pub(crate) dims: [u32; 3],
    pub(crate) stride_y: u32,
    pub(crate) stride_z: u32,
    /// One less than the number of cells, a power of two.
    pub(crate) mask: u32,
    /// The key of the first cell: levels share one row of keys.
    pub(crate) base: u32,
}

impl Cells {
    pub(crate) fn new(level: &LevelPlan, base: u32) -> Self {
        let [x, y, _] = level.dims;
        let steps = level.cell.map(|c| STEPS as f64 / f64::from(c));
        let max_extent = level.max_extent.map(f64::from);
        Self {
            origin: level.origin.map(f64::from),
            steps,
            max_extent,
            // Rounding of either corner, and a little.
            reach: std::array::from_fn(|k| (max_extent[k] * steps[k]) as u32 + 2),
            dims: level.dims,
            stride_y: x,
            stride_z: x * y,
            mask: level.cells - 1,
            base,
        }
    }

    /// Steps to coordinate `x` on axis `k`: monotone in `x`, all that correctness asks of it.
    #[inline(always)]
    fn step(&self, k: usize, x: f64) -> i64 {
        let scaled = (x - self.origin[k]) * self.steps[k];
        // One instruction each, and the conversion takes no NaN. Written as comparisons, they were several in some loops.
        #[expect(clippy::manual_clamp, reason = "it keeps a NaN, and tests for it")]
        let within = scaled.min(FARTHEST).max(-FARTHEST);
        // The lowest bits of a float of this size are an integer: a conversion that all lanes of a register make at once.
        (within + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as i64
    }

    #[inline(always)]
    fn steps_to(&self, point: &[f32; 3]) -> [i64; 3] {
        std::array::from_fn(|k| self.step(k, f64::from(point[k])))
    }

    #[inline(always)]
    fn cell(&self, point: &[f32; 3]) -> [i64; 3] {
        self.steps_to(point).map(|steps| steps >> STEP_BITS)
    }

    /// The cell of a box, and where that cell is.
    pub(crate) fn bounds(&self, one: &Aabb) -> ([i64; 3], Aabb) {
        let cell = self.cell(&one.min);
        // Steps are rounded to the nearest.
        let corner = |i: i64, k: usize| (self.origin[k] + ((i * STEPS) as f64 - 0.5) / self.steps[k]) as f32;
        let low = std::array::from_fn(|k| corner(cell[k], k));
        (cell, Aabb::new(low, std::array::from_fn(|k| corner(cell[k] + 1, k))))
    }

    /// The cells in which the lower corner of a box that overlaps `one` can lie: from where the
    /// largest box of the level would begin, to the cell of the upper corner.
    #[inline(always)]
    pub(crate) fn window(&self, one: &Aabb) -> ([i64; 3], [i64; 3]) {
        let lowest = |k: usize| self.step(k, f64::from(one.min[k]) - self.max_extent[k]) >> STEP_BITS;
        (std::array::from_fn(lowest), self.cell(&one.max))
    }

    /// Whether few boxes reach beyond their cell: none is much larger than a third of one.
    pub(crate) fn are_spacious(&self) -> bool {
        self.reach.iter().all(|&reach| reach <= STEPS as u32 * 3 / 8)
    }

    /// The key of the cell that a box is stored in.
    #[inline(always)]
    pub(crate) fn place(&self, one: &Aabb) -> u32 {
        self.key(self.cell(&one.min))
    }

    #[inline(always)]
    pub(crate) fn key(&self, cell: [i64; 3]) -> u32 {
        self.base + self.wrap(self.offset(cell))
    }

    /// Truncation to 32 bits is a remainder too, by a multiple of M.
    #[inline(always)]
    fn offset(&self, cell: [i64; 3]) -> u32 {
        let y = (cell[1] as u32).wrapping_mul(self.stride_y);
        let z = (cell[2] as u32).wrapping_mul(self.stride_z);
        (cell[0] as u32).wrapping_add(y).wrapping_add(z)
    }

    #[inline(always)]
    pub(crate) fn wrap(&self, key: u32) -> u32 {
        key & self.mask
    }

    /// The code of a box of the level.
    #[inline(always)]
    pub(crate) fn code(&self, one: &Aabb) -> u64 {
        let (low, high) = (self.steps_to(&one.min), self.steps_to(&one.max));
        let field = |steps: i64, k: usize| (steps as u64 & FIELD) << SHIFTS[k];
        let halves = |k: usize| field(low[k].wrapping_neg(), k) | field(high[k], k) << 32;
        halves(0) | halves(1) | halves(2)
    }

    /// The code of any box as a query, if it is small enough: any box of the level may be as large as a cell.
    #[inline(always)]
    pub(crate) fn query(&self, one: &Aabb) -> Option<u64> {
        const LARGEST: i64 = 255 - STEPS - 1;
        let (low, high) = (self.steps_to(&one.min), self.steps_to(&one.max));
        (0..3).all(|k| high[k] - low[k] <= LARGEST).then(|| as_query(self.code(one)))
    }

    /// Which neighbouring cells the half window of a box needs.
    #[inline(always)]
    pub(crate) fn span(&self, code: u64) -> Span {
        let low = |k: usize| (code >> SHIFTS[k]).wrapping_neg() as u32 & FIELD as u32;
        let high = |k: usize| (code >> (32 + SHIFTS[k])) as u32 & FIELD as u32;
        let low = std::array::from_fn::<u32, 3, _>(low);
        let up = |k: usize| ((high(k) >> STEP_BITS).wrapping_sub(low[k] >> STEP_BITS)) & 1;
        let down = |k: usize| u32::from(low[k] & (STEPS as u32 - 1) <= self.reach[k]);
        Span { down_x: down(0), down_y: down(1), up_x: up(0), up_y: up(1), up_z: up(2) }
    }
}

/// A code with its halves exchanged.
#[inline(always)]
pub(super) fn as_query(code: u64) -> u64 {
    code.rotate_left(32)
}

/// Whether a box's window reaches into the next cell, down and up, 0 or 1 each: it never reaches further, because no
/// box of the level is as large as a cell. The half neighbourhood needs no lower z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) down_x: u32,
    pub(crate) down_y: u32,
    pub(crate) up_x: u32,
    pub(crate) up_y: u32,
    pub(crate) up_z: u32,
}

impl Span {
    /// All of them.
    pub(crate) const WHOLE: Self = Self { down_x: 1, down_y: 1, up_x: 1, up_y: 1, up_z: 1 };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(cell: f32, origin: f32) -> Cells {
        let level = LevelPlan {
            boxes: 1,
            classes: (0, 0),
            max_extent: [cell / LevelPlan::SPARE; 3],
            cell: [cell; 3],
            origin: [origin; 3],
            dims: [8; 3],
            cells: 512,
            crowd: 0.0,
            camp: 0,
        };
        Cells::new(&level, 0)
    }

    /// Boxes of a level at many places, among them cell borders and places beyond the last cell.
    fn boxes(cell: f32, scale: f32) -> impl Iterator<Item = Aabb> {
        (0..2000).map(move |i| {
            let min = (i as f32 * 0.377 - 300.0) * scale * cell;
            Aabb::new([min; 3], [min + cell / LevelPlan::SPARE * (i % 7) as f32 / 6.0; 3])
        })
    }

    fn fits(one: &Aabb, cell: f32) -> bool {
        one.extents()[0] <= cell / LevelPlan::SPARE
    }

    const CELLS: [f32; 6] = [1e-20, 1e-3, 0.3, 1.0, 777.0, 1e20];
    const SCALES: [f32; 7] = [0.0, 0.01, 1.0, 1e3, 1e6, 1e9, 1e12];

    #[test]
    fn cells_are_monotone_and_finite_for_every_float() {
        let cells = cells(0.3, -7.0);
        let mut floats: Vec<f32> =
            (0..=u16::MAX).map(|high| f32::from_bits(u32::from(high) << 16 | 0x1234)).collect();
        floats.retain(|x| !x.is_nan());
        floats.sort_unstable_by(f32::total_cmp);
        let found: Vec<i64> = floats.iter().map(|&x| cells.cell(&[x; 3])[0]).collect();
        assert!(found.is_sorted());
        assert_eq!((found[0], found[found.len() - 1]), (-(1 << 40), 1 << 40));
        assert_eq!(cells.cell(&[f32::NAN; 3])[0], 1 << 40);
    }

    #[test]
    fn windows_reach_one_cell_at_most_wherever_and_however_small_the_cells() {
        for cell in CELLS {
            for scale in SCALES {
                let cells = cells(cell, 0.1 * scale * cell);
                for one in boxes(cell, scale).filter(|one| fits(one, cell)) {
                    let ((low, high), own) = (cells.window(&one), cells.cell(&one.min));
                    let reach = (own[0] - low[0]).max(high[0] - own[0]);
                    assert!((0..=1).contains(&reach), "{reach}: cell {cell}, box {one:?}");
                    let span = cells.span(cells.code(&one));
                    assert!(i64::from(span.up_x) >= high[0] - own[0], "up: cell {cell}, box {one:?}");
                    assert!(i64::from(span.down_x) >= own[0] - low[0], "down: cell {cell}, box {one:?}");
                }
            }
        }
    }

    #[test]
    fn codes_of_boxes_that_overlap_say_so() {
        for cell in CELLS {
            for scale in SCALES {
                let cells = cells(cell, 0.1 * scale * cell);
                let boxes: Vec<Aabb> = boxes(cell, scale).filter(|one| fits(one, cell)).take(300).collect();
                for a in &boxes {
                    let query = cells.query(a).expect("a small box");
                    for b in boxes.iter().filter(|b| a.overlaps(b)) {
                        let sum = query.wrapping_add(cells.code(b));
                        assert_eq!(sum & APART, 0, "cell {cell}: {a:?} {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_query_of_any_size_has_a_code_that_is_right_or_none() {
        let cells = cells(1.0, 0.0);
        let cube = |at: f32, edge: f32| Aabb::new([at; 3], [at + edge; 3]);
        let queries: Vec<_> = (0..100).map(|i| cube(3.3, 0.1 * i as f32)).collect();
        let with_codes = || queries.iter().filter_map(|query| Some((query, cells.query(query)?)));
        assert!((10..90).contains(&with_codes().count()));
        for (query, code) in with_codes() {
            let level = (-50..250).map(|i| cube(0.07 * i as f32, 1.0 / LevelPlan::SPARE));
            for one in level.filter(|one| one.overlaps(query)) {
                assert_eq!(code.wrapping_add(cells.code(&one)) & APART, 0, "{query:?} {one:?}");
            }
        }
    }

    #[test]
    fn codes_part_boxes_that_are_a_few_steps_apart() {
        let cells = cells(1.0, 0.0);
        let at = |x: f32| Aabb::from_center([x, 0.5, 0.5], [0.2; 3]);
        let apart = |a: &Aabb, b: &Aabb| as_query(cells.code(a)).wrapping_add(cells.code(b)) & APART != 0;
        for gap in [0.05, 0.5, 1.5, 2.5] {
            assert!(apart(&at(0.3), &at(0.7 + gap)) && apart(&at(0.7 + gap), &at(0.3)), "{gap}");
        }
        assert!(!apart(&at(0.3), &at(0.6)));
        assert_eq!(cells.query(&Aabb::from_center([0.0; 3], [3.0; 3])), None, "too large for a code");
    }
}
