//! The settings of the broad phase.

use pbig_core::{Backend, Limits};

/// The settings of a [`crate::PbigBroadPhase`]. A later version may have more: end with `..PbigConfig::DEFAULT`.
///
/// ```
/// use rapier_pbig::{PbigBroadPhase, PbigConfig};
/// let config = PbigConfig { margin: 0.02, ..PbigConfig::DEFAULT };
/// let broad_phase = PbigBroadPhase::with_config(config)?;
/// # Ok::<(), rapier_pbig::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PbigConfig {
    /// The distance by which a stored AABB is larger than its collider's, in units of rapier's `length_unit`. A larger margin
    /// means that fewer colliders count as moved, and that more pairs are reported that do not touch yet. The default, 0.01,
    /// is that of rapier's own broad phase. The margin also covers rounding: without one, pairs are missed from a thousand
    /// units from the origin on (docs/ACCURACY.md).
    pub margin: f32,
    /// The processor that searches for pairs.
    pub backend: Backend,
    /// Maximum number of pairs. An update that would have more sends no events, and [`crate::PbigBroadPhase::last_error`]
    /// returns the error; the next update sees the same changes again. The default is the
    /// largest number that the core can keep: rapier has no limit.
    pub max_pairs: u64,
}

impl PbigConfig {
    /// The default settings.
    pub const DEFAULT: Self =
        Self { margin: 0.01, backend: Backend::Auto, max_pairs: Limits::UNLIMITED.max_pairs };
}

impl Default for PbigConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl From<PbigConfig> for pbig_core::Config {
    fn from(PbigConfig { margin, backend, max_pairs }: PbigConfig) -> Self {
        let limits = Limits { max_pairs, ..Limits::UNLIMITED };
        Self { margin, backend, limits, ..Self::DEFAULT }
    }
}
