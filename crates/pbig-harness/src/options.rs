//! Command-line options that the program and the examples share.

use clap::ValueEnum;
use pbig_core::Backend;

/// `--backend`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BackendOption {
    /// The backend that the policy chooses.
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
    /// The setting that this asks for.
    pub fn backend(self) -> Backend {
        match self {
            Self::Auto => Backend::Auto,
            Self::Cpu => Backend::Cpu,
            Self::Gpu => Backend::Gpu,
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
