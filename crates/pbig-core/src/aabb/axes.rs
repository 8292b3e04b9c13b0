//! One box with another, axis by axis, on any processor.

use super::Extremes;
use crate::Aabb;

#[inline(always)]
pub(crate) fn overlaps(one: &Aabb, other: &Aabb) -> bool {
    let on_axis = |k: usize| (one.min[k] <= other.max[k]) & (other.min[k] <= one.max[k]);
    on_axis(0) & on_axis(1) & on_axis(2)
}

/// Returns true if two boxes overlap, behind each of which lie two numbers.
#[inline(always)]
pub(crate) fn records_overlap(one: &[f32; 8], other: &[f32; 8]) -> bool {
    let on_axis = |k: usize| (one[k] <= other[k + 3]) & (other[k] <= one[k + 3]);
    on_axis(0) & on_axis(1) & on_axis(2)
}

/// Returns true if the gaps between a box and one around it are from 0 to `slack` on all sides; none if a gap is NaN, as between
/// equal infinities.
#[inline(always)]
pub(crate) fn gaps_are_within(aabb: &Aabb, outer: &Aabb, slack: f32) -> Option<bool> {
    let (mut is_within, mut is_known) = (true, true);
    for k in 0..3 {
        let (below, above) = (aabb.min[k] - outer.min[k], outer.max[k] - aabb.max[k]);
        is_within &= (below >= 0.0) & (below <= slack) & (above >= 0.0) & (above <= slack);
        is_known &= !below.is_nan() & !above.is_nan();
    }
    is_known.then_some(is_within)
}

/// Returns the extremes of some boxes and earlier ones. Numbers that are NaN do not count.
pub(crate) fn widened<'a>(earlier: Extremes, boxes: impl IntoIterator<Item = &'a Aabb>) -> Extremes {
    let [mut low, mut high, mut extent] = earlier;
    for aabb in boxes {
        for k in 0..3 {
            let size = aabb.max[k] - aabb.min[k];
            // Comparisons rather than `min` and `max`, which differ between processors in what a signalling NaN gives.
            low[k] = if aabb.min[k] < low[k] { aabb.min[k] } else { low[k] };
            high[k] = if aabb.max[k] > high[k] { aabb.max[k] } else { high[k] };
            extent[k] = if size > extent[k] { size } else { extent[k] };
        }
    }
    [low, high, extent]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_nan_do_not_widen() {
        let (nan, signalling_nan) = (f32::NAN, f32::from_bits(0x7F80_0001));
        let boxes = [
            Aabb::new([signalling_nan, nan, 1.0], [2.0, signalling_nan, nan]),
            Aabb::new([0.0, 3.0, signalling_nan], [1.0, 4.0, 9.0]),
        ];
        let [low, high, extent] = widened([[5.0; 4], [-5.0; 4], [0.0; 4]], &boxes);
        assert_eq!([low[..3].to_vec(), high[..3].to_vec()], [[0.0, 3.0, 1.0], [2.0, 4.0, 9.0]]);
        assert_eq!(extent[..3], [1.0, 1.0, 0.0]);
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod twins {
    use super::super::sse;
    use super::*;
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};

    /// Returns numbers by their bits, so that both zeros are equal.
    fn bits(of: Extremes) -> [[u32; 3]; 3] {
        of.map(|[x, y, z, _]| [x, y, z].map(|x| (x + 0.0).to_bits()))
    }

    #[test]
    fn all_axes_at_once_say_what_one_after_the_other_says() {
        let (tiny, signalling_nan) = (f32::MIN_POSITIVE / 2.0, f32::from_bits(0x7F80_0001));
        let numbers =
            [-1.0, -0.0, 0.0, tiny, 1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, signalling_nan];
        let mut random = StdRng::seed_from_u64(5);
        let mut met = [0; 2];
        for _ in 0..200_000 {
            let [a, b]: [[f32; 8]; 2] = [(); 2].map(|()| {
                std::array::from_fn(|_| numbers[random.random_range(0..9) % random.random_range(5..=9)])
            });
            let [one, other] =
                [a, b].map(|row| Aabb::new([row[0], row[1], row[2]], [row[3], row[4], row[5]]));
            let overlaps = overlaps(&one, &other);
            let grown = one.inflated(0.5);
            let gaps = gaps_are_within(&one, &grown, 1.0);
            assert_eq!(sse::overlaps(&one, &other), overlaps, "{one:?} {other:?}");
            assert_eq!([sse::records_overlap(&a, &b), records_overlap(&a, &b)], [overlaps; 2], "{a:?} {b:?}");
            assert_eq!(sse::gaps_are_within(&one, &grown, 1.0), gaps, "{one:?}");
            let (ours, twins) = (sse::gaps_are_within(&one, &other, 1.0), gaps_are_within(&one, &other, 1.0));
            assert_eq!(ours, twins, "{one:?} {other:?}");
            let earlier = [[0.5; 4], [-0.5; 4], [0.0; 4]];
            let boxes = [one, other];
            assert_eq!(bits(sse::widened(earlier, &boxes)), bits(widened(earlier, &boxes)), "{boxes:?}");
            met = [met[0] + u32::from(overlaps), met[1] + u32::from(gaps == Some(true))];
        }
        assert!(met.iter().all(|count| *count > 1000), "{met:?}");
    }
}
