//! The broad phases to choose from.

use clap::ValueEnum;
use rapier_pbig::{Backend, GpuFinder, PbigBroadPhase, PbigConfig};

/// `--backend`: a broad phase, and where it works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Choice {
    /// Rapier's own broad phase.
    Stock,
    /// Pbig, on the backend that its policy chooses.
    #[default]
    Auto,
    /// Pbig on the CPU.
    Cpu,
    /// Pbig on a GPU; without one the CPU does the work and the figures say so.
    Gpu,
}

impl Choice {
    /// Returns the name in figures.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stock => "stock (rapier's own)",
            Self::Auto => "pbig",
            Self::Cpu => "pbig on the CPU",
            Self::Gpu => "pbig on the GPU",
        }
    }

    /// Returns the broad phase that the key for the next one chooses: stock, pbig on the CPU and pbig on the GPU in turn.
    pub const fn next(self) -> Self {
        match self {
            Self::Stock => Self::Cpu,
            Self::Auto | Self::Cpu => Self::Gpu,
            Self::Gpu => Self::Stock,
        }
    }

    /// Returns pbig's broad phase, or `None` for stock.
    pub fn pbig(self) -> Option<PbigBroadPhase> {
        let backend = match self {
            Self::Stock => return None,
            Self::Auto => Backend::Auto,
            Self::Cpu => Backend::Cpu,
            Self::Gpu => Backend::Device,
        };
        let config = PbigConfig { backend, ..PbigConfig::DEFAULT };
        let mut pbig = PbigBroadPhase::with_config(config).expect("the default margin is a length");
        if self == Self::Gpu {
            pbig.set_device(Box::new(GpuFinder::shared()));
        }
        Some(pbig)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_key_reaches_stock_cpu_and_gpu_from_everywhere() {
        for &start in Choice::value_variants() {
            let mut reached = vec![start.next()];
            reached.push(reached[0].next());
            reached.push(reached[1].next());
            for wanted in [Choice::Stock, Choice::Cpu, Choice::Gpu] {
                assert!(reached.contains(&wanted), "{wanted:?} from {start:?}");
            }
        }
    }
}
