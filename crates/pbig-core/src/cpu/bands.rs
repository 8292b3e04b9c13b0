//! Bands: slices of an axis, numbered modulo 64, and which of them a box lies in.
//!
//! Numbers are monotone in the coordinate, rounding included, and so boxes that overlap share a band on each axis.

use crate::Aabb;

/// Bands of an axis: few enough that the rows of 1024 boxes, 24 KB, fit the first cache.
pub(super) const BANDS: usize = 64;

/// Numbers of bands are exact up to here to each side; beyond, boxes share the last.
const FARTHEST: f32 = (1 << 21) as f32;

/// Added to a number of at most that size it leaves the nearest integer in the low bits: a conversion without branches.
const ROUND: f32 = (3 << 22) as f32;

/// The bands of a box on the three axes, both ends included, modulo [`BANDS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) first: [u8; 4],
    pub(super) last: [u8; 4],
}

impl Span {
    /// Of a box that is nowhere.
    pub(super) const NONE: Self = Self { first: [u8::MAX; 4], last: [u8::MAX; 4] };

    /// Of a box that is valid or [`Aabb::NOWHERE`].
    #[inline(always)]
    pub(super) fn of(aabb: &Aabb, bands_per_unit: &[f32; 4]) -> Self {
        if aabb.min[0].is_nan() {
            return Self::NONE;
        }
        let first = numbers(&aabb.min, bands_per_unit);
        let last = numbers(&aabb.max, bands_per_unit);
        let mut span = Self { first: [0; 4], last: [0; 4] };
        for k in 0..4 {
            let all = last[k] - first[k] >= BANDS as u32 - 1;
            span.first[k] = if all { 0 } else { (first[k] % BANDS as u32) as u8 };
            span.last[k] = if all { BANDS as u8 - 1 } else { (last[k] % BANDS as u32) as u8 };
        }
        span
    }

    #[inline(always)]
    pub(super) fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// The two ends on an axis, the same where a box lies in one band.
    #[inline(always)]
    pub(super) fn ends(&self, axis: usize) -> [usize; 2] {
        [usize::from(self.first[axis]), usize::from(self.last[axis])]
    }

    /// Whether there are bands between the ends on any axis.
    #[inline(always)]
    pub(super) fn is_long(&self) -> bool {
        let between = |axis: usize| self.last[axis].wrapping_sub(self.first[axis]) % BANDS as u8 > 1;
        between(0) | between(1) | between(2)
    }

    /// Axis and number of the bands between the ends.
    pub(super) fn inner(self) -> impl Iterator<Item = (usize, usize)> {
        (0..3).flat_map(move |axis| {
            let [first, last] = self.ends(axis);
            let count = (last + BANDS - first) % BANDS;
            (first + 1..first + count).map(move |band| (axis, band % BANDS))
        })
    }
}

/// Numbers of the bands of a corner, each with the same number added; four at once.
#[inline(always)]
fn numbers(corner: &[f32; 3], bands_per_unit: &[f32; 4]) -> [u32; 4] {
    let corner = [corner[0], corner[1], corner[2], 0.0];
    let mut numbers = [0; 4];
    for k in 0..4 {
        numbers[k] = ((corner[k] * bands_per_unit[k]).clamp(-FARTHEST, FARTHEST) + ROUND).to_bits();
    }
    numbers
}

/// The width of the bands of an axis: seven boxes of eight lie in at most two; and where boxes are spread wider, no
/// more bands than that takes, so that a box stays in its own for longer.
pub(super) fn width(boxes: &[Aabb], axis: usize) -> f32 {
    let valid = || boxes.iter().filter(|aabb| aabb.is_valid());
    let mut extents: Vec<f32> = valid().map(|aabb| aabb.extents()[axis]).collect();
    let mut corners: Vec<f32> = valid().map(|aabb| aabb.min[axis]).collect();
    // A few boxes far away are no measure of where the others are.
    let spread = quantile(&mut corners, 7) - quantile(&mut corners, 1);
    let width = quantile(&mut extents, 7).max(spread * 1.5 / BANDS as f32);
    if width > 1e-30 && width < 1e30 { width } else { 1.0 }
}

/// The value above so many eighths of the others; 0 of none.
fn quantile(values: &mut [f32], eighths: usize) -> f32 {
    let place = values.len() * eighths / 8;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(place, f32::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the first axis, in the order of the bands.
    fn bands(span: Span) -> Vec<usize> {
        let [first, last] = span.ends(0);
        let inner = span.inner().filter(|(axis, _)| *axis == 0).map(|(_, band)| band);
        let mut bands: Vec<usize> = [first].into_iter().chain(inner).chain([last]).collect();
        bands.dedup();
        bands
    }

    #[test]
    fn a_box_lies_in_the_bands_from_its_lower_to_its_upper_corner() {
        let of = |min: f32, max: f32| Span::of(&Aabb::new([min; 3], [max; 3]), &[1.0; 4]);
        for (min, max, wanted) in [
            (3.0, 3.0, vec![3]),
            (2.6, 4.4, vec![3, 4]),
            (61.0, 66.0, vec![61, 62, 63, 0, 1, 2]),
            (-2.0, 1.0, vec![62, 63, 0, 1]),
            (f32::INFINITY, f32::INFINITY, vec![0]),
        ] {
            let span = of(min, max);
            assert_eq!(bands(span), wanted, "{min} to {max}");
            assert_eq!(span.is_long(), wanted.len() > 2);
        }
        for (min, max) in [(0.0, 63.0), (-1e9, 1e9), (f32::NEG_INFINITY, 5.0), (-f32::MAX, f32::MAX)] {
            assert_eq!(bands(of(min, max)), Vec::from_iter(0..64), "{min} to {max}");
        }
        assert!(Span::of(&Aabb::NOWHERE, &[1.0; 4]).is_none());
    }
}
