//! Coordinates in fewer bits end no pair: for all floats, two boxes that overlap may overlap in every kind of
//! coordinates of the study.

use pbig_core::Aabb;
use pbig_studies::precision::{
    CODE_STEPS, Code, Coordinates, Exact, FARTHEST, FIXED_STEPS, Fixed, Half, Scale, half_down, half_up,
    half_value,
};
use proptest::prelude::*;

/// Any float but NaN, every magnitude as likely: zeros, denormals and infinities too.
fn float() -> impl Strategy<Value = f32> {
    let special = prop::sample::select(vec![
        0.0,
        -0.0,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        65_504.0,
        65_520.0,
        f32::MAX,
        f32::INFINITY,
    ]);
    let special = (special, any::<bool>()).prop_map(|(x, negative)| if negative { -x } else { x });
    let any = any::<u32>().prop_map(f32::from_bits).prop_filter("NaN", |x| !x.is_nan());
    prop_oneof![4 => any, 1 => special]
}

fn sorted_box(corners: [[f32; 3]; 2]) -> Aabb {
    let [a, b] = corners;
    Aabb::new(std::array::from_fn(|k| a[k].min(b[k])), std::array::from_fn(|k| a[k].max(b[k])))
}

fn any_box() -> impl Strategy<Value = Aabb> {
    prop::array::uniform2(prop::array::uniform3(float())).prop_map(sorted_box)
}

/// A cell of any size and an origin anywhere; a box near the origin or far from it whose extents are at most a cell, and
/// one that begins where it does or ends, or somewhere near.
fn near_boxes() -> impl Strategy<Value = (Scale, Aabb, Aabb)> {
    let cell = (-30i32..30).prop_map(|power| 2f32.powi(power) * 1.1);
    let far = || prop::array::uniform3((-1f32..1.0, 0i32..62).prop_map(|(x, power)| x * 2f32.powi(power)));
    let place = (far(), prop::array::uniform3(-9f32..9.0), any::<bool>());
    let parts = prop::array::uniform4(prop::array::uniform3(0f32..=1.0));
    (cell, place, parts).prop_map(|(cell, (origin, place, beside), [a, b, c, touch])| {
        let origin = origin.map(|x| x * cell);
        let low: [f32; 3] = std::array::from_fn(|k| place[k] * cell + if beside { origin[k] } else { 0.0 });
        let scale = Scale { origin, cell };
        let first = small(low, a, cell);
        let begin = std::array::from_fn(|k| match touch[k] {
            t if t < 0.3 => first.max[k],
            t if t < 0.4 => first.min[k],
            _ => first.min[k] + (b[k] - 0.5) * cell,
        });
        (scale, first, small(begin, c, cell))
    })
}

/// From a corner, extents of parts of a cell: less by rounding, where floats are coarse.
fn small(low: [f32; 3], parts: [f32; 3], cell: f32) -> Aabb {
    let fits = |low: f32, high: f32| f64::from(high) - f64::from(low) <= f64::from(cell);
    let high = |k: usize| Some(low[k] + parts[k] * cell).filter(|high| fits(low[k], *high)).unwrap_or(low[k]);
    Aabb::new(low, std::array::from_fn(high))
}

fn may_overlap<C: Coordinates>(scale: &Scale, a: &Aabb, b: &Aabb) -> bool {
    let (a, b) = (C::of(a, scale), C::of(b, scale));
    let (there, back) = (a.may_overlap(b), b.may_overlap(a));
    assert_eq!(there, back, "{}", C::NAME);
    there
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100_000, ..ProptestConfig::default() })]

    /// Outward, and in the order of the floats.
    #[test]
    fn f16_is_rounded_outward(x in float(), y in float()) {
        prop_assert!(half_value(half_down(x)) <= x && x <= half_value(half_up(x)));
        if x <= y {
            prop_assert!(half_down(x) <= half_down(y) && half_up(x) <= half_up(y) && half_down(x) <= half_up(y));
        }
    }

    #[test]
    fn f16_ends_no_pair_of_any_boxes(a in any_box(), b in any_box()) {
        let scale = Scale { origin: [0.0; 3], cell: 1.0 };
        prop_assert_eq!(may_overlap::<Exact>(&scale, &a, &b), a.overlaps(&b));
        prop_assert!(!a.overlaps(&b) || may_overlap::<Half>(&scale, &a, &b));
    }

    #[test]
    fn steps_keep_the_order_of_all_floats(x in float(), y in float(), cell in (-30i32..30), steps in 1u32..9000) {
        let scale = Scale { origin: [-7.3; 3], cell: 2f32.powi(cell) };
        prop_assert!(scale.down(0, x, steps) <= scale.up(0, x, steps));
        if x <= y {
            prop_assert!(scale.down(0, x, steps) <= scale.down(0, y, steps));
            prop_assert!(scale.up(0, x, steps) <= scale.up(0, y, steps));
        }
    }

    /// At any distance, also where steps are finer than floats.
    #[test]
    fn fixed_point_and_codes_end_no_pair_of_boxes_within_cells((scale, a, b) in near_boxes()) {
        let overlap = a.overlaps(&b);
        prop_assert!(!overlap || may_overlap::<Fixed<true>>(&scale, &a, &b));
        prop_assert!(!overlap || may_overlap::<Fixed<false>>(&scale, &a, &b));
        prop_assert!(!overlap || may_overlap::<Code>(&scale, &a, &b));
    }
}

/// A float by its place in the order of all: from the one below 0 that is furthest to infinity.
fn in_order(place: i64) -> f32 {
    let bits = place.unsigned_abs() as u32;
    f32::from_bits(if place < 0 { bits | 1 << 31 } else { bits })
}

const INFINITE: i64 = 0x7f80_0000;

/// Outward, and none before the one before it: with that the rounding of f16 is proved for the floats looked at.
fn f16_is_right_for(places: std::ops::Range<i64>) {
    let mut before = [half_down(in_order(places.start)), half_up(in_order(places.start))];
    for x in places.map(in_order) {
        let [down, up] = [half_down(x), half_up(x)];
        assert!(half_value(down) <= x && x <= half_value(up), "{x:e}");
        assert!(before[0] <= down && before[1] <= up, "{x:e}: not in order");
        before = [down, up];
    }
}

/// Where the answer changes: around each f16.
#[test]
fn f16_is_rounded_outward_and_in_order_around_each_of_them() {
    for bits in 0..0x7c00u32 {
        let x = i64::from(half_value(bits as i16).to_bits());
        f16_is_right_for(x - 3..x + 4);
        f16_is_right_for(-x - 3..-x + 4);
    }
    f16_is_right_for(INFINITE - 3..INFINITE + 1);
    f16_is_right_for(-INFINITE..3 - INFINITE);
}

/// Outward, in order, and the one below no more than a step from the one above: with that a minimum never comes after a maximum
/// that it does not exceed, which is all that a pair needs.
fn steps_are_right_for(scale: &Scale, steps: u32, places: std::ops::Range<i64>) {
    both_are_right_for(scale, steps, places, |x| [scale.down(0, x, steps), scale.up(0, x, steps)]);
}

fn both_are_right_for(
    scale: &Scale,
    steps: u32,
    places: std::ops::Range<i64>,
    both: impl Fn(f32) -> [i64; 2],
) {
    let mut before = both(in_order(places.start));
    for x in places.map(in_order) {
        let [down, up] = both(x);
        assert!(down <= up && up - down <= 1, "{x:e}: from {down} to {up}");
        // Steps as distances, while f64 can tell them apart; further away all are one.
        let at = f64::from(x) - f64::from(scale.origin[0]);
        let nearly = at.abs() * 4.0 * f64::EPSILON;
        let edge = f64::from(scale.cell) / f64::from(steps);
        let (low, high) = (down as f64 * edge - nearly, up as f64 * edge + nearly);
        let is_far = at.abs() >= FARTHEST * f64::from(scale.cell);
        assert!(is_far || low <= at && at <= high, "{x:e}: not between {low:e} and {high:e}");
        assert!(before[0] <= down && before[1] <= up, "{x:e}: not in order");
        before = [down, up];
    }
}

/// Cells from small to large, whose origin is that of the world, near it, or far away; as fixed point and codes count them.
fn scales() -> impl Iterator<Item = (Scale, u32)> {
    let cells = [(2f32.powi(-30), -7.3), (1.0, 0.0), (1.1, 1e6), (2f32.powi(30) * 1.1, -0.3)];
    let scale = |(cell, origin): (f32, f32)| Scale { origin: [origin * cell; 3], cell };
    cells.into_iter().map(scale).flat_map(|scale| [(scale, FIXED_STEPS), (scale, CODE_STEPS)])
}

/// Where the answer changes: around steps near the origin, and around where coordinates are clamped.
#[test]
fn fixed_point_is_rounded_outward_and_in_order_around_steps() {
    for (scale, steps) in scales() {
        let at = |cells: f64| (f64::from(scale.origin[0]) + cells * f64::from(scale.cell)) as f32;
        let place = |x: f32| if x < 0.0 { -i64::from((-x).to_bits()) } else { i64::from(x.to_bits()) };
        let whole = (-3000..3000).map(|step| f64::from(step) / f64::from(steps));
        for cells in whole.chain([FARTHEST, -FARTHEST, 1e300, -1e300]) {
            let x = place(at(cells).clamp(f32::MIN, f32::MAX));
            steps_are_right_for(&scale, steps, (x - 3).max(-INFINITE)..(x + 4).min(INFINITE + 1));
        }
    }
}

const ONE_TO_TWO: std::ops::Range<i64> = 0x3f80_0000..0x4000_0000;

#[test]
#[should_panic(expected = "not in order")]
fn steps_that_are_out_of_order_are_seen() {
    // Where coordinates are clamped nothing else would tell.
    let scale = Scale { origin: [0.0; 3], cell: 2f32.powi(-40) };
    both_are_right_for(&scale, 64, ONE_TO_TWO, |x| [(-1000.0 * x) as i64; 2]);
}

#[test]
#[should_panic(expected = "not between")]
fn steps_that_are_rounded_inward_are_seen() {
    let scale = Scale { origin: [0.0; 3], cell: 1.0 };
    both_are_right_for(&scale, 64, ONE_TO_TWO, |x| [scale.down(0, x, 64); 2]);
}

/// Boxes that are a step or so apart, which rounding may join, and more, which it may not: or a test that lets
/// everything through would pass.
#[test]
fn boxes_that_are_apart_are_told_apart() {
    let scale = Scale { origin: [0.0; 3], cell: 1.0 };
    let a = Aabb::new([5.0; 3], [5.5; 3]);
    for (gap, axis) in [0.25f32, 1.0].into_iter().flat_map(|gap| (0..3).map(move |axis| (gap, axis))) {
        let mut b = a;
        (b.min[axis], b.max[axis]) = (5.5 + gap, 6.0 + gap);
        assert!(!may_overlap::<Fixed<true>>(&scale, &a, &b) && !may_overlap::<Fixed<false>>(&scale, &a, &b));
        assert!(!may_overlap::<Half>(&scale, &a, &b) && !may_overlap::<Code>(&scale, &a, &b));
    }
}
