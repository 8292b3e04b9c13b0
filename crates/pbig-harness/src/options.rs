//! Command-line options that the program and the examples share, and what they choose.

use clap::ValueEnum;
use pbig_core::{Backend, BroadPhase, Config, Error, Finder, PairDevice};
use pbig_gpu::{GpuFinder, GpuOptions};
use rapier_pbig::{PbigBroadPhase, PbigConfig};

/// `--backend`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BackendOption {
    /// The backend that the policy chooses: here the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// A GPU; without one the CPU does the work and the output says so.
    Gpu,
    /// Every pair is tested.
    Brute,
}

impl BackendOption {
    pub fn for_rapier(self) -> PbigBroadPhase {
        self.for_rapier_on(shared_gpu(self.backend(), GpuOptions::DEFAULT))
    }

    /// Returns a broad phase for rapier, on a device if there is one.
    pub fn for_rapier_on(self, device: Option<Box<dyn PairDevice>>) -> PbigBroadPhase {
        let config = PbigConfig { backend: self.backend(), ..PbigConfig::DEFAULT };
        let mut broad_phase = PbigBroadPhase::with_config(config).expect("the default margin is a length");
        if let Some(device) = device {
            broad_phase.set_device(device);
        }
        broad_phase
    }

    pub fn backend(self) -> Backend {
        match self {
            Self::Auto => Backend::Auto,
            Self::Cpu => Backend::Cpu,
            Self::Gpu => Backend::Device,
            Self::Brute => Backend::Brute,
        }
    }

    /// The backend that does the work, if `fallback` says why it is not the one asked for.
    pub fn in_use(self, fallback: Option<&str>) -> &'static str {
        match self {
            Self::Brute => "brute",
            Self::Gpu if fallback.is_none() => "gpu",
            _ => "cpu",
        }
    }
}

/// Returns the GPU that the process shares, if this backend asks for a device.
pub fn shared_gpu(backend: Backend, options: GpuOptions) -> Option<Box<dyn PairDevice>> {
    let gpu = || Box::new(GpuFinder::shared().with_options(options)) as Box<dyn PairDevice>;
    (backend == Backend::Device).then(gpu)
}

/// Returns a finder, on the shared GPU if the settings ask for a device.
pub fn finder(config: Config, options: GpuOptions) -> Finder {
    match shared_gpu(config.backend, options) {
        Some(gpu) => Finder::with_device(config, gpu),
        None => Finder::new(config),
    }
}

/// As [`finder`], a broad phase.
pub fn broad_phase(config: Config, options: GpuOptions) -> Result<BroadPhase, Error> {
    match shared_gpu(config.backend, options) {
        Some(gpu) => BroadPhase::with_device(config, gpu),
        None => BroadPhase::new(config),
    }
}
