//! The settings of the finder.

pbig_adapter::define_config! {
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
    ///
    pub struct PbigConfig {
        /// The default, 0.04, is that of rapier's own broad phase. Not used with `adaptive_change_detection_margin`.
        margin: crate::MARGIN
    }
}
