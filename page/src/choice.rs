//! The broad phases to choose from.

use crate::remote::RemoteDevice;
use rapier_pbig::{Backend, PbigBroadPhase, PbigConfig};
use std::str::FromStr;

/// A broad phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Rapier's own.
    Stock,
    /// pbig's, on the CPU.
    Pbig,
    /// pbig's, on the page's GPU.
    Gpu,
}

impl Choice {
    /// Returns pbig's broad phase, or `None` for rapier's own.
    pub(crate) fn pbig(self) -> Option<PbigBroadPhase> {
        match self {
            Self::Stock => None,
            Self::Pbig => Some(PbigBroadPhase::new()),
            Self::Gpu => Some(on_device(RemoteDevice::gpu())),
        }
    }
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "stock" => Ok(Self::Stock),
            "pbig" => Ok(Self::Pbig),
            "gpu" => Ok(Self::Gpu),
            _ => Err(format!("no broad phase is called '{name}'; there are: stock, pbig, gpu")),
        }
    }
}

/// Returns pbig's broad phase on a device that does every call.
pub(crate) fn on_device(device: RemoteDevice) -> PbigBroadPhase {
    let config = PbigConfig { backend: Backend::Device, ..PbigConfig::DEFAULT };
    PbigBroadPhase::with_device(config, Box::new(device)).expect("the default margin is a length")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_name_is_answered_with_the_right_ones() {
        assert_eq!("pbig".parse(), Ok(Choice::Pbig));
        let error = "grid".parse::<Choice>().unwrap_err();
        assert!(error.contains("'grid'") && error.contains("stock, pbig, gpu"), "{error}");
    }
}
