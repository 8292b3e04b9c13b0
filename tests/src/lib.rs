//! The corpus: sets of boxes that every strategy must get right, with the strategies to try.

use pbig_core::{
    Aabb, Backend, CellRule, Coding, Config, GpuOptions, Grids, Look, Pair, Strategy, Study, Updates,
};
use pbig_harness::boxes::BoxSet;
use std::io::Write;
use std::sync::LazyLock;

/// A set of boxes with a name to read in a failure.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is.
    pub name: String,
    /// The boxes.
    pub boxes: Vec<Aabb>,
}

/// Whether `PBIG_GPU=none` leaves devices out: where a driver must not run, as beside a sanitizer that cannot look into
/// it. Said once, and by each test that asks.
///
/// # Panics
/// With `CI=true`, and with another value.
pub fn without_gpu() -> bool {
    static IS_LEFT_OUT: LazyLock<bool> = LazyLock::new(|| {
        let [gpu, ci] = ["PBIG_GPU", "CI"].map(|name| std::env::var(name).ok());
        let is_left_out = leaves_out(gpu.as_deref(), ci.as_deref()).unwrap_or_else(|why| panic!("{why}"));
        if is_left_out {
            // Macros would leave it to the first test, which keeps it to itself if it passes.
            let _ = writeln!(
                std::io::stderr(),
                "PBIG_GPU=none: no strategy runs on a GPU, and tests of it do nothing"
            );
        }
        is_left_out
    });
    if *IS_LEFT_OUT {
        println!("left out: PBIG_GPU=none");
    }
    *IS_LEFT_OUT
}

/// By the values of `PBIG_GPU` and `CI`.
fn leaves_out(gpu: Option<&str>, ci: Option<&str>) -> Result<bool, String> {
    match (gpu, ci) {
        (None, _) => Ok(false),
        (Some("none"), Some("true")) => Err("CI=true tests the GPU, too: not with PBIG_GPU=none".to_owned()),
        (Some("none"), _) => Ok(true),
        (Some(other), _) => Err(format!("PBIG_GPU={other}: it may be none, or not set")),
    }
}

/// Whether a test may find pairs so.
pub fn may_run(config: &Config) -> bool {
    config.backend != Backend::Gpu || !without_gpu()
}

/// Ends a test, or what is left of it, where devices are left out: the one way for all that need one.
#[macro_export]
macro_rules! needs_gpu {
    () => {
        if $crate::without_gpu() {
            return;
        }
    };
}

/// Every way to find pairs, by name.
pub fn strategies() -> Vec<(&'static str, Config)> {
    let with = |backend, strategy| Config { backend, strategy, ..Config::DEFAULT };
    let all = vec![
        ("auto", Config::DEFAULT),
        ("grid", with(Backend::Cpu, Strategy::Grid)),
        ("pbig", with(Backend::Cpu, Strategy::Pbig)),
        ("pbig by density", by_density(with(Backend::Cpu, Strategy::Pbig))),
        ("pbig rows", by_rows(with(Backend::Cpu, Strategy::Pbig))),
        ("brute", with(Backend::Brute, Strategy::Auto)),
        ("gpu", with(Backend::Gpu, Strategy::Auto)),
        ("gpu grid", gpu(Coding::Plain)),
        ("gpu grid packed", gpu(Coding::Packed)),
    ];
    all.into_iter().filter(|(_, config)| may_run(config)).collect()
}

fn by_density(config: Config) -> Config {
    Config { gpu: GpuOptions { cell_rule: CellRule::Density, ..config.gpu }, ..config }
}

fn by_rows(config: Config) -> Config {
    Config { gpu: GpuOptions { small_cell: 1, ..config.gpu }, ..config }
}

/// Ways on the CPU that the plan would not choose everywhere, by name.
pub fn asked() -> Vec<(&'static str, Config)> {
    let grid = Config { backend: Backend::Cpu, strategy: Strategy::Grid, ..Config::DEFAULT };
    let with = |study| Config { study, ..grid };
    let by = |updates| with(Study { updates, ..Study::DEFAULT });
    let of = |grids, look| with(Study { grids, look, ..Study::DEFAULT });
    vec![
        ("edits", by(Updates::Edits)),
        ("grid anew", by(Updates::Anew)),
        ("near pairs", by(Updates::Near)),
        ("levels, rows everywhere", of(Grids::Levels, Look::Everywhere)),
        ("levels, trimmed rows", of(Grids::Levels, Look::Trimmed)),
        ("one grid, trimmed rows", of(Grids::One, Look::Trimmed)),
        ("one grid, rows seldom", of(Grids::One, Look::Seldom)),
    ]
}

/// The grid on the GPU, whatever the size of the set.
pub fn gpu(coding: Coding) -> Config {
    let options = GpuOptions { coding, all_pairs_up_to: 0, ..GpuOptions::DEFAULT };
    Config { backend: Backend::Gpu, gpu: options, ..Config::DEFAULT }
}

/// The corpus.
pub fn corpus() -> Vec<Case> {
    let mut cases = sets();
    cases.extend(by_hand().into_iter().map(|(name, boxes)| Case { name: name.into(), boxes }));
    cases
}

/// How a list of pairs differs from the oracle's, if it does: the first fault, in words.
pub fn difference(found: &[Pair], wanted: &[Pair]) -> Option<String> {
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

/// A lattice of touching cubes whose faces lie on multiples of `edge`: on the borders of cells.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ci_is_never_without_a_gpu() {
        assert_eq!(leaves_out(None, Some("true")), Ok(false));
        assert_eq!([None, Some("")].map(|ci| leaves_out(Some("none"), ci)), [Ok(true), Ok(true)]);
        assert!(leaves_out(Some("none"), Some("true")).is_err_and(|why| why.contains("CI=true")));
        assert!(leaves_out(Some("some"), None).is_err_and(|why| why.contains("PBIG_GPU=some")));
    }
}
