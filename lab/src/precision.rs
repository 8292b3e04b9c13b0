//! Coordinates in fewer bits, for study: what a search's tests could read instead of f32, and the rounding that
//! keeps them from missing a pair: outward, so that what is stored of a minimum is never above it, and what is stored of a maximum
//! never below.

use half::f16;
use pbig_core::Aabb;
use pbig_harness::bench::timed;

/// Boxes as a test reads them.
pub trait Coordinates: Copy {
    /// For tables.
    const NAME: &'static str;
    /// True if the answer is exact: only boxes that overlap may overlap.
    const EXACT: bool = false;

    /// From a box without NaN whose extents are at most a cell.
    fn of(aabb: &Aabb, scale: &Scale) -> Self;

    /// Returns true if two boxes may overlap whose lower corners lie in touching cells.
    fn may_overlap(self, other: Self) -> bool;
}

/// Minima, then maxima. All six comparisons, as the outcome of each is a coin toss.
#[inline(always)]
fn overlap<T: PartialOrd>(a: [T; 6], b: [T; 6]) -> bool {
    (0..3).fold(true, |all, k| all & (a[k] <= b[k + 3]) & (b[k] <= a[k + 3]))
}

/// As they are.
#[derive(Clone, Copy, Debug)]
pub struct Exact([f32; 6]);

impl Coordinates for Exact {
    const NAME: &'static str = "f32";
    const EXACT: bool = true;

    #[inline(always)]
    fn of(aabb: &Aabb, _: &Scale) -> Self {
        Self(bytemuck::cast([aabb.min, aabb.max]))
    }

    #[inline(always)]
    fn may_overlap(self, other: Self) -> bool {
        overlap(self.0, other.0)
    }
}

/// 16-bit fixed point, [`FIXED_STEPS`] to a cell, eight cells before it wraps around. `OUTWARD`: maxima are rounded
/// up; otherwise everything is rounded down, which is monotone and so misses nothing either.
#[derive(Clone, Copy, Debug)]
pub struct Fixed<const OUTWARD: bool>([u16; 6]);

/// Differences that mean anything are less than three cells, and must be less than 2^15 steps.
pub const FIXED_STEPS: u32 = 8192;

impl<const OUTWARD: bool> Coordinates for Fixed<OUTWARD> {
    const NAME: &'static str =
        if OUTWARD { "16-bit fixed point, outward" } else { "16-bit fixed point, all down" };

    #[inline(always)]
    fn of(aabb: &Aabb, scale: &Scale) -> Self {
        let low = |k: usize| scale.down(k, aabb.min[k], FIXED_STEPS) as u16;
        let high = |k: usize| {
            let x = aabb.max[k];
            (if OUTWARD { scale.up(k, x, FIXED_STEPS) } else { scale.down(k, x, FIXED_STEPS) }) as u16
        };
        Self(bytemuck::cast([[0, 1, 2].map(low), [0, 1, 2].map(high)]))
    }

    #[inline(always)]
    fn may_overlap(self, other: Self) -> bool {
        let (a, b) = (self.0, other.0);
        let reaches = |high: u16, low: u16| high.wrapping_sub(low) as i16 >= 0;
        (0..3).fold(true, |all, k| all & reaches(b[k + 3], a[k]) & reaches(a[k + 3], b[k]))
    }
}

/// f16 of the world's coordinates, as integers in the same order.
#[derive(Clone, Copy, Debug)]
pub struct Half([i16; 6]);

impl Coordinates for Half {
    const NAME: &'static str = "f16, outward";

    #[inline(always)]
    fn of(aabb: &Aabb, _: &Scale) -> Self {
        Self(bytemuck::cast([aabb.min.map(half_down), aabb.max.map(half_up)]))
    }

    #[inline(always)]
    fn may_overlap(self, other: Self) -> bool {
        overlap(self.0, other.0)
    }
}

/// As pbig's CPU tests them (`pbig-core/src/grid/cells.rs`): six fields of ten bits, 64 steps to a cell, everything
/// rounded down; one addition and one test for all six comparisons.
#[derive(Clone, Copy, Debug)]
pub struct Code(u64);

/// Steps of a [`Code`] to a cell.
pub const CODE_STEPS: u32 = 64;

impl Coordinates for Code {
    const NAME: &'static str = "64-bit code";

    #[inline(always)]
    fn of(aabb: &Aabb, scale: &Scale) -> Self {
        let step = |k: usize, x: f32| scale.down(k, x, CODE_STEPS);
        let field = |steps: i64, k: usize| (steps as u64 & 511) << (10 * k);
        let low: u64 = (0..3).map(|k| field(-step(k, aabb.min[k]), k)).sum();
        let high: u64 = (0..3).map(|k| field(step(k, aabb.max[k]), k)).sum();
        Self(low | high << 32)
    }

    #[inline(always)]
    fn may_overlap(self, other: Self) -> bool {
        // The ninth bit of each difference `max - min`: set where that is below 0.
        const APART: u64 = 0x1004_0100_1004_0100;
        self.0.rotate_left(32).wrapping_add(other.0) & APART == 0
    }
}

/// Coordinates are clamped to this many cells of the origin. Up to here f64 tells the smallest steps apart; beyond, all
/// coordinates share one place, which costs tests and never a pair. Without it steps would be rounded to multiples of
/// what fixed point wraps around at.
pub const FARTHEST: f64 = (1u64 << 32) as f64;

/// An integer for each f16, in their order; -0 just below 0.
fn ordered(half: f16) -> i16 {
    let bits = half.to_bits() as i16;
    bits ^ (((bits >> 15) as u16) >> 1) as i16
}

/// The value of an integer in the order of f16.
pub fn half_value(integer: i16) -> f32 {
    // The order's inverse is itself.
    f16::from_bits((integer ^ (((integer >> 15) as u16) >> 1) as i16) as u16).to_f32()
}

/// The largest f16 that is not above `x`, as an integer in the order of f16; `x` is not a NaN.
#[inline]
pub fn half_down(x: f32) -> i16 {
    // Zeros are one: a box that ends at -0 touches one that begins at 0.
    let x = x + 0.0;
    let nearest = f16::from_f32(x);
    ordered(nearest) - i16::from(nearest.to_f32() > x)
}

/// The smallest f16 that is not below `x`, as an integer in the order of f16; `x` is not a NaN.
#[inline]
pub fn half_up(x: f32) -> i16 {
    let x = x + 0.0;
    let nearest = f16::from_f32(x);
    ordered(nearest) + i16::from(nearest.to_f32() < x)
}

/// From coordinates to steps of cells.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// The lower corner of cell 0.
    pub origin: [f32; 3],
    /// The edge of a cell; above 0.
    pub cell: f32,
}

impl Scale {
    #[inline(always)]
    fn cells(&self, axis: usize, x: f32) -> f64 {
        let cells = (f64::from(x) - f64::from(self.origin[axis])) / f64::from(self.cell);
        cells.clamp(-FARTHEST, FARTHEST)
    }

    /// The cell that contains a coordinate.
    pub fn cell(&self, axis: usize, x: f32) -> i64 {
        self.down(axis, x, 1)
    }

    /// Whole steps up to a coordinate: monotone, and never above it.
    #[inline(always)]
    pub fn down(&self, axis: usize, x: f32, steps: u32) -> i64 {
        let exact = self.cells(axis, x) * f64::from(steps);
        let whole = exact as i64;
        whole - i64::from((whole as f64) > exact)
    }

    /// Whole steps to the next one at or above a coordinate: monotone, and never below it.
    #[inline(always)]
    pub fn up(&self, axis: usize, x: f32, steps: u32) -> i64 {
        let exact = self.cells(axis, x) * f64::from(steps);
        let whole = exact as i64;
        whole + i64::from((whole as f64) < exact)
    }
}

/// The most cells; more make cells larger.
const MOST_CELLS: f64 = (1u64 << 23) as f64;

/// Boxes in the order of their cells, and which of them are tested against which.
pub(crate) struct Candidates {
    scale: Scale,
    boxes: Vec<Aabb>,
    /// A box, and others in consecutive places.
    runs: Vec<[u32; 3]>,
}

/// The findings of tests in some kind of coordinates.
#[derive(Clone, Copy, Default)]
pub(crate) struct Found {
    pub(crate) tests: u64,
    /// Pairs that may overlap, and those of them that do.
    pub(crate) candidates: u64,
    pub(crate) pairs: u64,
    /// Milliseconds of rounding the boxes, testing them, and testing in f32 what may overlap, where that is not exact.
    pub(crate) encode: f64,
    pub(crate) test: f64,
    pub(crate) recheck: f64,
}

impl Candidates {
    /// Sorts boxes into a grid by lower corners, cells as large as the largest extent: valid and finite ones, at least one.
    pub(crate) fn new(boxes: &[Aabb]) -> Self {
        let all = boxes.iter().fold(boxes[0], |all, b| all.union(b));
        let extents = |b: &Aabb| (0..3).map(|k| b.max[k] - b.min[k]).fold(0.0, f32::max);
        // Up once: the difference may have been rounded down.
        let largest = boxes.iter().map(extents).fold(f32::MIN_POSITIVE, f32::max).next_up();
        let side = |k: usize| f64::from(all.max[k]) - f64::from(all.min[k]) + f64::from(largest);
        let cell = ((0..3).map(side).product::<f64>() / MOST_CELLS).cbrt() as f32;
        let scale = Scale { origin: all.min, cell: largest.max(cell) };
        let dims = std::array::from_fn(|k| scale.cell(k, all.max[k]) as usize + 1);
        sorted(boxes, scale, dims)
    }

    /// Tests all that lie near each other; `kept` is room that is used again.
    pub(crate) fn find<C: Coordinates>(&self, kept: &mut Vec<[u32; 2]>) -> Found {
        let (codes, encode) = timed(|| self.boxes.iter().map(|b| C::of(b, &self.scale)).collect::<Vec<_>>());
        let (tests, test) = timed(|| self.test(&codes, kept));
        let candidates = kept.len() as u64;
        let overlap = |[i, j]: &[u32; 2]| self.boxes[*i as usize].overlaps(&self.boxes[*j as usize]);
        let recheck = || kept.iter().map(|pair| u64::from(overlap(pair))).sum();
        let (pairs, recheck) = if C::EXACT { (candidates, 0.0) } else { timed(recheck) };
        Found { tests, candidates, pairs, encode, test, recheck }
    }

    /// Without a branch on the result, which no processor could foresee.
    fn test<C: Coordinates>(&self, codes: &[C], kept: &mut Vec<[u32; 2]>) -> u64 {
        let (mut tests, mut count) = (0, 0);
        for &[i, from, to] in &self.runs {
            tests += u64::from(to - from);
            if kept.len() < count + (to - from) as usize {
                kept.resize(2 * kept.len() + (to - from) as usize, [0; 2]);
            }
            let code = codes[i as usize];
            for (j, &other) in (from..to).zip(&codes[from as usize..to as usize]) {
                kept[count] = [i, j];
                count += usize::from(code.may_overlap(other));
            }
        }
        kept.truncate(count);
        tests
    }
}

/// Sorts boxes by cell, and lists for each the others in its own and in half of the neighbouring cells.
fn sorted(boxes: &[Aabb], scale: Scale, dims: [usize; 3]) -> Candidates {
    let place = |b: &Aabb| -> [usize; 3] { std::array::from_fn(|k| scale.cell(k, b.min[k]) as usize) };
    let key = |[x, y, z]: [usize; 3]| (z * dims[1] + y) * dims[0] + x;
    let mut order: Vec<(usize, Aabb)> = boxes.iter().map(|b| (key(place(b)), *b)).collect();
    order.sort_by_key(|(key, _)| *key);
    let start = |key: usize| order.partition_point(|(other, _)| *other < key) as u32;
    let mut runs = Vec::new();
    for (i, (key_of, b)) in (0u32..).zip(&order) {
        let [x, y, z] = place(b);
        // The rest of its own row, to the next cell; then four rows, from the cell before to the next.
        let last = (x + 1).min(dims[0] - 1);
        runs.push([i, i + 1, start(key_of - x + last + 1)]);
        for (y, z) in [(Some(y + 1), z), (y.checked_sub(1), z + 1), (Some(y), z + 1), (Some(y + 1), z + 1)] {
            let Some(y) = y.filter(|y| *y < dims[1] && z < dims[2]) else { continue };
            let row = key([0, y, z]);
            runs.push([i, start(row + x.saturating_sub(1)), start(row + last + 1)]);
        }
    }
    runs.retain(|[_, from, to]| from < to);
    Candidates { scale, boxes: order.into_iter().map(|(_, b)| b).collect(), runs }
}
