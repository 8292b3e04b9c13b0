//! The settings of the finder.

use pbig_core::{Backend, Limits};

/// The settings of a [`crate::PbigFinder`].
///
/// ```
/// # use rapier as rapier3d;
/// use rapier_pbig::PbigConfig;
/// use rapier3d::prelude::BroadPhaseBvh;
/// let mut broad_phase = BroadPhaseBvh::new();
/// let config = PbigConfig { margin: 0.02, ..PbigConfig::DEFAULT };
/// rapier_pbig::install_with(&mut broad_phase, config)?;
/// # Ok::<(), rapier_pbig::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PbigConfig {
    /// The distance by which a stored AABB is larger than its collider's, in units of rapier's `length_unit`. A larger margin
    /// means that fewer colliders count as moved, and that more pairs are reported that do not touch yet. The default, 0.04,
    /// is that of rapier's own broad phase. Not used with `adaptive_change_detection_margin`.
    pub margin: f32,
    /// The processor that searches for pairs.
    pub backend: Backend,
    /// Maximum number of pairs. An update that would have more sends no events, and [`crate::PbigFinder::last_error`] returns
    /// the error; the next update sees the same changes again. The default is the largest number that the core can keep:
    /// rapier has no limit.
    pub max_pairs: u64,
}

impl PbigConfig {
    /// The default settings.
    pub const DEFAULT: Self =
        Self { margin: crate::MARGIN, backend: Backend::Auto, max_pairs: Limits::UNLIMITED.max_pairs };
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
