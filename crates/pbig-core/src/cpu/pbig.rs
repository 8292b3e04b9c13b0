//! PBIG's own grid (Lo et al. 2013, 4.2 and 4.3), plain and scalar.
//!
//! Every box has an entry in each cell it touches. Pairs are tested within a cell: small cells
//! through Avril's index to pair mapping, large ones by PBIG's balanced rows. A pair that meets in
//! several cells is reported by its owner: the component-wise maximum of the lower cells of its
//! boxes, which is the cell of the paper's "corner of the intersection with the largest
//! coordinates" when lower corners are meant, in integers, so exact on every device (contract 3).

use super::check::Checker;
use super::entries::{Entries, Query};
use super::found::{Found, Room};
use super::judge::Accept;
use crate::pair_index::{pair_count, pair_of, row_len, row_pair};
use crate::plan::PbigPlan;
use crate::report::Checks;
use crate::{Aabb, Error, Pair};

/// The cells that a box touches, both ends included.
#[derive(Clone, Copy, Debug)]
struct Touched {
    low: [u32; 3],
    high: [u32; 3],
}

impl Touched {
    fn new(plan: &PbigPlan, one: &Aabb) -> Self {
        let cell = |k: usize, x: f32| {
            let scaled = (x - plan.origin[k]) * (1.0 / plan.cell);
            scaled.clamp(0.0, (plan.dims[k] - 1) as f32) as u32
        };
        Self {
            low: std::array::from_fn(|k| cell(k, one.min[k])),
            high: std::array::from_fn(|k| cell(k, one.max[k])),
        }
    }

    fn count(&self) -> u64 {
        (0..3).map(|k| u64::from(self.high[k] - self.low[k] + 1)).product()
    }

    /// The keys of the cells, row by row.
    fn keys(self, dims: [u32; 3]) -> impl Iterator<Item = usize> {
        let key = move |x: u32, y: u32, z: u32| ((z * dims[1] + y) * dims[0] + x) as usize;
        (self.low[2]..=self.high[2]).flat_map(move |z| {
            (self.low[1]..=self.high[1])
                .flat_map(move |y| (self.low[0]..=self.high[0]).map(move |x| key(x, y, z)))
        })
    }
}

/// The grid: for each cell a range of `places`, each the index of a box in `boxes`.
#[derive(Clone, Debug, Default)]
pub(crate) struct PbigGrid {
    offsets: Vec<u32>,
    places: Vec<u32>,
    boxes: Vec<Aabb>,
    ids: Vec<u32>,
    lowest: Vec<[u32; 3]>,
    /// Boxes that touch too many cells: tested against all.
    list: Entries,
}

impl PbigGrid {
    /// Count, scan, scatter: the three kernels of PBIG 4.2.
    pub(crate) fn build(&mut self, plan: &PbigPlan, boxes: &[Aabb]) {
        let touched = self.select(plan, boxes);
        let cells = plan.dims.iter().product::<u32>() as usize;
        self.offsets.clear();
        self.offsets.resize(cells + 1, 0);
        for key in touched.iter().flat_map(|t| t.keys(plan.dims)) {
            self.offsets[key] += 1;
        }
        let mut sum = 0;
        for offset in &mut self.offsets {
            sum += *offset;
            *offset = sum;
        }
        self.places.clear();
        self.places.resize(sum as usize, 0);
        for (place, t) in touched.iter().enumerate().rev() {
            for key in t.keys(plan.dims) {
                self.offsets[key] -= 1;
                self.places[self.offsets[key] as usize] = place as u32;
            }
        }
        self.lowest.clear();
        self.lowest.extend(touched.iter().map(|t| t.low));
    }

    /// Valid boxes into `boxes` with the cells they touch, oversize ones into `list`.
    fn select(&mut self, plan: &PbigPlan, boxes: &[Aabb]) -> Vec<Touched> {
        self.boxes.clear();
        self.ids.clear();
        self.list.clear();
        let (mut touched, mut entries) = (Vec::new(), 0);
        for (id, aabb) in boxes.iter().enumerate().filter(|(_, b)| b.is_valid()) {
            let cells = Touched::new(plan, aabb);
            // Places are counted in 32 bits.
            let countable = entries + cells.count() <= u64::from(u32::MAX);
            if cells.count() > u64::from(plan.max_cells_per_box) || !countable {
                self.list.push(aabb, id as u32);
            } else {
                self.boxes.push(*aabb);
                self.ids.push(id as u32);
                entries += cells.count();
                touched.push(cells);
            }
        }
        touched
    }

    /// All overlapping pairs that `accept` takes; returns the checks as the paper counts them.
    pub(crate) fn find<A>(
        &self,
        plan: &PbigPlan,
        small_cell: u32,
        accept: &A,
        max_pairs: u64,
        found: &mut Found,
    ) -> Result<Checks, Error>
    where
        A: Accept,
    {
        let room = Room::new(max_pairs);
        let out = &mut found.buffers(1)[0];
        let mut cell = CellChecker { grid: self, plan, accept, out, checks: Checks::default(), taken: 0 };
        for key in 0..self.offsets.len() - 1 {
            if !cell.check(key, small_cell, &room) {
                break;
            }
        }
        let mut checks = cell.checks;
        let mut taken = cell.taken;
        let mut checker = Checker::new(accept, out);
        // The list against itself, then every other box against the list.
        for (i, (stored, &id)) in self.list.boxes.iter().zip(&self.list.ids).enumerate() {
            checker.test(&stored.query(), id, &self.list, i + 1..self.list.len());
            if !room.take(checker.out.len(), &mut taken) {
                break;
            }
        }
        for (aabb, &id) in self.boxes.iter().zip(&self.ids) {
            checker.test(&Query::new(aabb), id, &self.list, 0..self.list.len());
            if !room.take(checker.out.len(), &mut taken) {
                break;
            }
        }
        checks.made += checker.checks;
        checks.unnecessary += checker.checks - checker.overlaps;
        room.settle(found.len())?;
        Ok(checks)
    }
}

/// Tests pairs within cells.
struct CellChecker<'a, A> {
    grid: &'a PbigGrid,
    plan: &'a PbigPlan,
    accept: &'a A,
    out: &'a mut Vec<Pair>,
    checks: Checks,
    taken: usize,
}

impl<A: Accept> CellChecker<'_, A> {
    fn check(&mut self, key: usize, small_cell: u32, room: &Room) -> bool {
        let range = self.grid.offsets[key] as usize..self.grid.offsets[key + 1] as usize;
        let places = &self.grid.places[range];
        let n = places.len() as u32;
        if n <= small_cell {
            for k in 0..pair_count(u64::from(n)) {
                let (i, j) = pair_of(k, u64::from(n));
                self.test(key, places[i as usize], places[j as usize]);
            }
            return room.take(self.out.len(), &mut self.taken);
        }
        (0..n).all(|row| {
            for (i, j) in (0..row_len(row, n)).map(|k| row_pair(row, k, n)) {
                self.test(key, places[i as usize], places[j as usize]);
            }
            room.take(self.out.len(), &mut self.taken)
        })
    }

    #[inline]
    fn test(&mut self, key: usize, i: u32, j: u32) {
        let (i, j) = (i as usize, j as usize);
        self.checks.made += 1;
        if self.owner(i, j) != key {
            self.checks.redundant += 1;
            return;
        }
        if !self.grid.boxes[i].overlaps(&self.grid.boxes[j]) {
            self.checks.unnecessary += 1;
            return;
        }
        let pair = Pair::new(self.grid.ids[i], self.grid.ids[j]);
        if self.accept.pair(pair) {
            self.out.push(pair);
        }
    }

    /// The key of the cell that reports the pair.
    fn owner(&self, i: usize, j: usize) -> usize {
        let (a, b) = (self.grid.lowest[i], self.grid.lowest[j]);
        let cell: [u32; 3] = std::array::from_fn(|k| a[k].max(b[k]));
        let dims = self.plan.dims;
        ((cell[2] * dims[1] + cell[1]) * dims[0] + cell[0]) as usize
    }
}
