//! Coordinates in fewer bits, for study: what a search's tests could read instead of f32, and the rounding that
//! keeps them from missing a pair: outward, so that what is stored of a minimum is never above it, and what is stored of a maximum
//! never below.

mod search;

pub(crate) use search::{Candidates, Found};

use half::f16;
use pbig_core::Aabb;

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
    (a[0] <= b[3]) & (a[1] <= b[4]) & (a[2] <= b[5]) & (b[0] <= a[3]) & (b[1] <= a[4]) & (b[2] <= a[5])
}

/// As they are.
#[derive(Clone, Copy, Debug)]
pub struct Exact([f32; 6]);

impl Coordinates for Exact {
    const NAME: &'static str = "f32";
    const EXACT: bool = true;

    #[inline(always)]
    fn of(aabb: &Aabb, _: &Scale) -> Self {
        let ([a, b, c], [d, e, f]) = (aabb.min, aabb.max);
        Self([a, b, c, d, e, f])
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
        Self([low(0), low(1), low(2), high(0), high(1), high(2)])
    }

    #[inline(always)]
    fn may_overlap(self, other: Self) -> bool {
        let (a, b) = (self.0, other.0);
        let reaches = |high: u16, low: u16| high.wrapping_sub(low) as i16 >= 0;
        reaches(b[3], a[0])
            & reaches(b[4], a[1])
            & reaches(b[5], a[2])
            & reaches(a[3], b[0])
            & reaches(a[4], b[1])
            & reaches(a[5], b[2])
    }
}

/// f16 of the world's coordinates, as integers in the same order.
#[derive(Clone, Copy, Debug)]
pub struct Half([i16; 6]);

impl Coordinates for Half {
    const NAME: &'static str = "f16, outward";

    #[inline(always)]
    fn of(aabb: &Aabb, _: &Scale) -> Self {
        let ([a, b, c], [d, e, f]) = (aabb.min.map(half_down), aabb.max.map(half_up));
        Self([a, b, c, d, e, f])
    }

    #[inline(always)]
    fn may_overlap(self, other: Self) -> bool {
        overlap(self.0, other.0)
    }
}

/// As pbig's CPU tests them (`pbig-core/src/cpu/cells.rs`): six fields of ten bits, 64 steps to a cell, everything
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

/// The largest f16 that is not above `x`, as an integer in the order of f16; `x` is no NaN.
#[inline]
pub fn half_down(x: f32) -> i16 {
    // Zeros are one: a box that ends at -0 touches one that begins at 0.
    let x = x + 0.0;
    let nearest = f16::from_f32(x);
    ordered(nearest) - i16::from(nearest.to_f32() > x)
}

/// The smallest f16 that is not below `x`, as an integer in the order of f16; `x` is no NaN.
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
