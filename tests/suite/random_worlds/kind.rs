//! Which broad phase random worlds are played with.

use pbig_core::Config;
use rapier_pbig::PbigBroadPhase;

/// The broad phase under test.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub(super) config: Config,
}

impl From<Config> for Kind {
    fn from(config: Config) -> Self {
        Self { config }
    }
}

impl Kind {
    pub(super) fn pbig(self) -> PbigBroadPhase {
        PbigBroadPhase::with_config(self.config)
    }

    /// How far apart pairs may be.
    pub(super) fn margin(self) -> f32 {
        self.config.margin
    }
}
