//! The corpus, with the backends and engines to try on it.

pub use pbig_harness::boxes::shifted;
pub use pbig_harness::corpus::{Case, corpus, difference};

use pbig_core::{Aabb, Backend, BroadPhase, Config, Engine, Finder, PairDevice, ProxyFilter};
use pbig_gpu::GpuOptions;
use pbig_harness::boxes::BoxSet;
use pbig_harness::options;
use std::io::Write;
use std::ops::Deref;
use std::sync::LazyLock;

/// A way to find pairs: settings, and those of the GPU if they ask for a device.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// The settings of the core.
    pub config: Config,
    /// The settings of the GPU.
    pub gpu: GpuOptions,
}

impl From<Config> for Way {
    fn from(config: Config) -> Self {
        Self { config, gpu: GpuOptions::DEFAULT }
    }
}

impl Deref for Way {
    type Target = Config;

    fn deref(&self) -> &Config {
        &self.config
    }
}

impl Way {
    /// Returns the way with other settings of the core.
    pub fn with(mut self, change: impl FnOnce(&mut Config)) -> Self {
        change(&mut self.config);
        self
    }

    /// Returns a finder.
    pub fn finder(&self) -> Finder {
        options::finder(self.config, self.gpu)
    }

    /// Returns a broad phase.
    ///
    /// # Panics
    /// If the margin is no length.
    pub fn broad_phase(&self) -> BroadPhase {
        options::broad_phase(self.config, self.gpu).expect("a good margin")
    }

    /// Returns the GPU, if the settings ask for a device.
    pub fn device(&self) -> Option<Box<dyn PairDevice>> {
        options::shared_gpu(self.config.backend, self.gpu)
    }
}

/// Returns true if `PBIG_GPU=none` leaves devices out: where a driver must not run, as beside a sanitizer that cannot look into
/// it. The first call prints this; each test that asks does so, too.
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

/// Returns true if devices are left out, by the values of `PBIG_GPU` and `CI`.
///
/// # Errors
/// With `CI=true`, and with another value of `PBIG_GPU`.
pub fn leaves_out(gpu: Option<&str>, ci: Option<&str>) -> Result<bool, String> {
    match (gpu, ci) {
        (None, _) => Ok(false),
        (Some("none"), Some("true")) => Err("CI=true tests the GPU, too: not with PBIG_GPU=none".to_owned()),
        (Some("none"), _) => Ok(true),
        (Some(other), _) => Err(format!("PBIG_GPU={other}: it may be none, or not set")),
    }
}

/// Returns true if a test may find pairs with this configuration.
pub fn may_run(config: &Config) -> bool {
    config.backend != Backend::Device || !without_gpu()
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

/// Every way in which the CPU finds all pairs, by name.
pub fn on_cpu() -> [(&'static str, Config); 4] {
    [
        ("auto", Config::DEFAULT),
        ("grid", grid()),
        ("tree", Config { engine: Some(Engine::Tree), ..grid() }),
        ("brute", Config { backend: Backend::Brute, ..Config::DEFAULT }),
    ]
}

/// Every way to find all pairs, by name.
pub fn strategies() -> Vec<(&'static str, Way)> {
    let on_gpu =
        [("gpu", Config { backend: Backend::Device, ..Config::DEFAULT }.into()), ("gpu grid", gpu())];
    let all = on_cpu().map(|(name, config)| (name, config.into())).into_iter().chain(on_gpu);
    all.filter(|(_, way)| may_run(way)).collect()
}

/// The CPU's grid, however few the boxes.
pub fn grid() -> Config {
    Config { backend: Backend::Cpu, engine: Some(Engine::Grid), ..Config::DEFAULT }
}

/// The CPU's engines for updates where the policy would not choose them, by name.
pub fn engines() -> Vec<(&'static str, Way)> {
    let by = |engine: Engine| (engine.name(), Config { engine: Some(engine), ..grid() }.into());
    Engine::ALL.map(by).into()
}

/// The grid on the GPU, for sets of every size.
pub fn gpu() -> Way {
    let gpu = GpuOptions { all_pairs_up_to: 0, count_tests: true, ..GpuOptions::DEFAULT };
    Way { config: Config { backend: Backend::Device, ..Config::DEFAULT }, gpu }
}

/// Returns a set of boxes by name.
///
/// # Panics
/// If there is no such set.
pub fn set(name: &str, n: usize, seed: u64) -> Vec<Aabb> {
    BoxSet::named(name).expect("the set exists").boxes(n, seed)
}

/// Sets boxes without filters, by place in the list.
///
/// # Panics
/// If the broad phase refuses one.
pub fn set_all(broad_phase: &mut BroadPhase, boxes: &[Aabb]) {
    for (id, aabb) in (0..).zip(boxes) {
        broad_phase.set(id, *aabb, ProxyFilter::ALL).expect("a small id");
    }
}

/// Runs something on a pool of its own.
///
/// # Panics
/// If there can be no pool with this number of threads.
pub fn on_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(run)
}
