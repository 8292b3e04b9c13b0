//! The result of a search on a device.

use super::GpuPlan;
use crate::Pair;
use crate::report::{Checks, GpuReport};

/// The pairs that a device found, and how it found them. There is none of a search that failed.
#[derive(Debug)]
pub(crate) struct GpuFound {
    /// Pairs, each once, in no particular order: a list for each piece of decoded output.
    ///
    /// [`super::GpuFinder::find`]: all pairs that overlap and that the filters allow.
    /// [`super::GpuFinder::changes`]: allowed pairs that overlap now and did not at the last update, or the other way
    /// round. The boxes tell which of the two.
    pub(crate) pairs: Vec<Vec<Pair>>,
    /// Ids of boxes that the device treated as new, see [`super::GpuFinder::changes`]. Empty for a search of all pairs.
    pub(crate) restarted: Vec<u32>,
    /// Number of valid boxes; in a search for changes, of boxes that are valid now or were at the last update.
    pub(crate) valid: u32,
    /// The grid; none if every pair was tested, or if fewer than two boxes are valid. Of several parts, the last one's.
    pub(crate) plan: Option<GpuPlan>,
    pub(crate) checks: Checks,
    pub(crate) report: GpuReport,
}
