//! Everything at once: sets and worlds that mix all that the other tests have one by one.

use super::{at_length, everywhere, through_updates};
use pbig_core::Aabb;
use pbig_harness::boxes::BoxSet;
use proptest::prelude::*;

/// A number of any kind: plain, by decades, next to a power of two, or special.
fn number() -> impl Strategy<Value = f32> {
    let decades = (-38i32..39, -1.0f32..1.0).prop_map(|(decade, x)| x * 10f32.powi(decade));
    let special = prop::sample::select(vec![
        0.0,
        -0.0,
        f32::from_bits(1),
        -f32::MIN_POSITIVE,
        1e30,
        f32::MAX,
        -f32::MAX,
        0.5 * f32::MAX,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
    ]);
    let beside = (-20i32..20, -1i32..2).prop_map(|(power, ulps)| {
        let x = (power as f32).exp2();
        f32::from_bits(x.to_bits().wrapping_add_signed(ulps))
    });
    prop_oneof![4 => -4.0f32..4.0, 2 => decades, 1 => special, 1 => beside]
}

fn point() -> impl Strategy<Value = [f32; 3]> {
    prop::array::uniform3(number())
}

/// A box from corner to corner, around a place, a needle, a plate, a point, or one with its corners as they come.
fn aabb() -> impl Strategy<Value = Aabb> {
    let sorted = |a: [f32; 3], b: [f32; 3]| {
        Aabb::new(std::array::from_fn(|k| a[k].min(b[k])), std::array::from_fn(|k| a[k].max(b[k])))
    };
    let size = (-6i32..7).prop_map(|decade| 10f32.powi(decade));
    let around = (point(), size.clone()).prop_map(|(at, size)| Aabb::from_center(at, [size; 3]));
    let near = prop::array::uniform3(-3.0f32..3.0);
    let thin = (near.clone(), size, 0usize..3, any::<bool>()).prop_map(|(at, size, axis, needle)| {
        let mut half = if needle { [0.0; 3] } else { [size; 3] };
        half[axis] = if needle { size } else { 0.0 };
        Aabb::from_center(at, half)
    });
    let raster = (prop::array::uniform3(-3i8..4), 0i8..3)
        .prop_map(|(at, size)| Aabb::new(at.map(f32::from), at.map(|x| f32::from(x + size))));
    prop_oneof![
        2 => (point(), point()).prop_map(move |(a, b)| sorted(a, b)),
        1 => (point(), point()).prop_map(|(a, b)| Aabb::new(a, b)),
        3 => around,
        2 => thin,
        3 => raster,
        3 => near.prop_map(|at| Aabb::from_center(at, [0.5; 3])),
    ]
}

fn boxes(most: usize) -> impl Strategy<Value = Vec<Aabb>> {
    // Some of them many times over, among a crowd of ordinary ones.
    (prop::collection::vec((aabb(), 1usize..4), 1..most), 0usize..60).prop_map(|(different, ordinary)| {
        let again = different.iter().flat_map(|(aabb, times)| std::iter::repeat_n(*aabb, *times));
        again.chain(BoxSet::ALL[4].boxes(ordinary, 1)).collect()
    })
}

fn cases() -> u32 {
    if at_length() { 2000 } else { 24 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_mixture_of_boxes_in_changing_places(boxes in boxes(80)) {
        everywhere("mixture", &boxes);
    }

    #[test]
    fn any_mixture_becomes_any_other(frames in prop::collection::vec(boxes(60), 2..5)) {
        through_updates("mixtures", &frames);
    }
}
