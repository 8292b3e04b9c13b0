//! Which broad phase random worlds are played with.

use pbig_core::Config;
use rapier_pbig::PbigBroadPhase;

/// The broad phase under test.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub(super) config: Config,
    pub(super) overlapped: bool,
}

impl From<Config> for Kind {
    fn from(config: Config) -> Self {
        Self { config, overlapped: false }
    }
}

impl Kind {
    pub(super) fn pbig(self) -> PbigBroadPhase {
        let pbig = PbigBroadPhase::with_config(self.config);
        if self.overlapped { pbig.overlapped() } else { pbig }
    }

    /// How far apart pairs may be.
    pub(super) fn margin(self) -> f32 {
        if self.overlapped { f32::INFINITY } else { self.config.margin }
    }
}
