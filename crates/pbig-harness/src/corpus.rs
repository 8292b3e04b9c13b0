//! The corpus: sets of boxes for which every algorithm must find the oracle's pairs.

use crate::boxes::BoxSet;
use pbig_core::{Aabb, Pair};

/// A set of boxes with a name, which failures report.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: String,
    pub boxes: Vec<Aabb>,
}

/// Returns the corpus: the generated sets in several sizes, then the sets made by hand.
pub fn corpus() -> Vec<Case> {
    let mut cases = sets();
    cases.extend(by_hand().into_iter().map(|(name, boxes)| Case { name: name.into(), boxes }));
    cases
}

/// Returns, in words, the first difference between a list of pairs and the oracle's list.
pub fn difference(found: &[Pair], wanted: &[Pair]) -> Option<String> {
    // The oracle's list is sorted and free of duplicates, so an equal one is, too.
    if found == wanted {
        return None;
    }
    if let Some(pair) = found.iter().find(|pair| pair.a >= pair.b) {
        return Some(format!("{pair:?} is not a < b"));
    }
    for two in found.windows(2) {
        match two[0].cmp(&two[1]) {
            std::cmp::Ordering::Less => {}
            std::cmp::Ordering::Equal => return Some(format!("twice: {:?}", two[0])),
            std::cmp::Ordering::Greater => return Some(format!("out of order: {two:?}")),
        }
    }
    let missing = wanted.iter().find(|pair| found.binary_search(pair).is_err());
    let spurious = found.iter().find(|pair| wanted.binary_search(pair).is_err());
    missing
        .map(|pair| format!("missing: {pair:?}, of {} pairs", wanted.len()))
        .or(spurious.map(|pair| format!("spurious: {pair:?}, beside {} pairs", wanted.len())))
}

fn sets() -> Vec<Case> {
    let sizes = [0, 1, 2, 3, 63, 64, 65, 300, 3000];
    let case = |set: BoxSet, n| Case { name: format!("{} {n}", set.name), boxes: set.boxes(n, n as u64) };
    BoxSet::ALL.into_iter().flat_map(|set| sizes.map(|n| case(set, n))).collect()
}

fn cube(center: [f32; 3], half: f32) -> Aabb {
    Aabb::from_center(center, [half; 3])
}

/// Makes a lattice of touching cubes. Their faces lie on multiples of `edge`, where borders of cells lie, too.
fn lattice(side: usize, edge: f32, at: [f32; 3]) -> Vec<Aabb> {
    let corner = |i: usize| [i % side, i / side % side, i / side / side].map(|c| c as f32 * edge);
    let shifted = |i: usize| -> [f32; 3] { std::array::from_fn(|k| corner(i)[k] + at[k]) };
    (0..side.pow(3)).map(|i| Aabb::new(shifted(i), shifted(i).map(|x| x + edge))).collect()
}

fn line(n: usize, step: [f32; 3], half: f32) -> Vec<Aabb> {
    (0..n).map(|i| cube(step.map(|s| s * i as f32), half)).collect()
}

fn with(mut boxes: Vec<Aabb>, more: &[Aabb]) -> Vec<Aabb> {
    boxes.extend_from_slice(more);
    boxes
}

fn by_hand() -> Vec<(&'static str, Vec<Aabb>)> {
    let infinite = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
    let half_space = Aabb::new([-0.5 * f32::MAX; 3], [0.5 * f32::MAX; 3]);
    let points_at_infinity = Aabb::new([f32::INFINITY; 3], [f32::INFINITY; 3]);
    vec![
        ("all invalid", vec![Aabb::NOWHERE; 200]),
        ("all identical", vec![cube([1.0; 3], 1.0); 500]),
        ("identical points", vec![cube([3.0; 3], 0.0); 500]),
        ("touching lattice", lattice(9, 1.0, [0.0; 3])),
        ("touching lattice of thirds", lattice(9, 1.0 / 3.0, [-1.0; 3])),
        ("touching lattice far away", lattice(9, 1.0, [1e6, -1e6, 3e6])),
        ("touching lattice beyond the resolution of f32", lattice(9, 1.0, [1e9; 3])),
        ("negative side", lattice(9, 0.7, [-1000.0; 3])),
        ("line along x", line(700, [0.9, 0.0, 0.0], 0.5)),
        ("line along z", line(700, [0.0, 0.0, 0.9], 0.5)),
        ("diagonal", line(700, [0.9; 3], 0.5)),
        ("plane", (0..900).map(|i| cube([(i % 30) as f32, 0.0, (i / 30) as f32], 0.5)).collect()),
        (
            "infinite boxes among small ones",
            with(lattice(6, 1.0, [0.0; 3]), &[infinite, half_space, infinite]),
        ),
        ("points at infinity", with(lattice(6, 1.0, [0.0; 3]), &[points_at_infinity; 3])),
        ("one far away", with(lattice(6, 1.0, [0.0; 3]), &[cube([1e30; 3], 1e29), cube([-3e38; 3], 1e38)])),
        ("two clusters", with(lattice(8, 1.0, [0.0; 3]), &lattice(8, 1.0, [1e6; 3]))),
        (
            "many clusters that wrap onto each other",
            (0..6).flat_map(|i| lattice(5, 1.0, [i as f32 * 1e4; 3])).collect(),
        ),
        (
            "sizes over twelve decades",
            (0..600).map(|i| cube([(i % 7) as f32; 3], 10f32.powf((i % 121) as f32 / 10.0 - 6.0))).collect(),
        ),
        ("one large among small", with(lattice(8, 1.0, [0.0; 3]), &[cube([4.0; 3], 50.0)])),
        (
            "needles crossing",
            (0..400)
                .map(|i| {
                    let mut h = [0.01; 3];
                    h[i % 3] = 60.0;
                    Aabb::from_center([(i % 11) as f32, (i % 13) as f32, (i % 17) as f32], h)
                })
                .collect(),
        ),
        ("denormals", (0..400).map(|i| cube([i as f32 * 1e-42; 3], 1e-42)).collect()),
        ("negative zero", vec![Aabb::new([-0.0; 3], [0.0; 3]), Aabb::new([0.0; 3], [-0.0; 3])]),
        (
            "largest floats",
            with(
                lattice(6, 1.0, [0.0; 3]),
                &[Aabb::new([f32::MAX; 3], [f32::MAX; 3]), Aabb::new([-f32::MAX; 3], [f32::MAX; 3])],
            ),
        ),
    ]
}
