//! The settings of the broad phase.

pbig_adapter::define_config! {
    /// The settings of a [`crate::PbigBroadPhase`].
    ///
    /// ```
    /// use rapier_pbig::{PbigBroadPhase, PbigConfig};
    /// let config = PbigConfig { margin: 0.02, ..PbigConfig::DEFAULT };
    /// let broad_phase = PbigBroadPhase::with_config(config)?;
    /// # Ok::<(), rapier_pbig::Error>(())
    /// ```
    ///
    pub struct PbigConfig {
        /// The default, 0.01, is that of rapier's own broad phase. The margin also covers rounding: without one, pairs are missed
        /// from a thousand units from the origin on (docs/ACCURACY.md).
        margin: 0.01
    }
}
