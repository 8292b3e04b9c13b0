//! Boxes with a margin around them.

use pbig_core::Aabb;

/// Returns a box grown by `margin` on every side, rounded outward. An invalid box stays as it is.
pub fn grown(aabb: &Aabb, margin: f64) -> Aabb {
    if !aabb.is_valid() {
        return *aabb;
    }
    let min = aabb.min.map(|x| minus(x.into(), margin));
    let max = aabb.max.map(|x| -minus((-x).into(), margin));
    Aabb::from_f64(min, max)
}

/// Returns `a - b`, or the number before it where f64 rounds up.
fn minus(a: f64, b: f64) -> f64 {
    let difference = a - b;
    // The exact error (Knuth's TwoSum); NaN if `a` is infinite.
    let subtracted = difference - a;
    let error = (a - (difference - subtracted)) + (-b - subtracted);
    if error < 0.0 { difference.next_down() } else { difference }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_margin_is_rounded_outward() {
        let b = grown(&Aabb::new([0.0; 3], [1.0; 3]), 0.1);
        assert_eq!((b.min, b.max), ([-0.1f32; 3], [1.1f32; 3]));
        assert!(f64::from(b.min[0]) < -0.1 && f64::from(b.max[0]) > 1.1);
        // Differences that f64 cannot hold.
        let b = grown(&Aabb::new([1e30; 3], [1e30; 3]), 1e-30);
        assert_eq!((b.min, b.max), ([1e30f32.next_down(); 3], [1e30f32.next_up(); 3]));
        let b = grown(&Aabb::new([-1.0; 3], [-1.0; 3]), 1e-30);
        assert_eq!((b.min, b.max), ([(-1f32).next_down(); 3], [(-1f32).next_up(); 3]));
    }

    #[test]
    fn without_a_margin_and_beyond_f32_boxes_stay_as_they_are() {
        let all = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        assert_eq!((grown(&all, 1.0), grown(&all, 0.0)), (all, all));
        let inverted = Aabb::new([1.0; 3], [0.9; 3]);
        assert_eq!(grown(&inverted, 5.0), inverted);
        assert!(!grown(&Aabb::NOWHERE, 5.0).is_valid());
        let b = Aabb::new([0.1, -0.0, 1e-40], [0.3, 0.0, f32::MAX]);
        assert_eq!(grown(&b, 0.0), b);
        assert_eq!(grown(&b, 1.0).max[2], f32::INFINITY);
    }
}
