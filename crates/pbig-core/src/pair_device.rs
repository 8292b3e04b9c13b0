//! The door for other processors: a [`PairDevice`] finds pairs for a [`crate::Finder`] or a [`crate::BroadPhase`].

use crate::{Aabb, Checks, DeviceReport, PairList, ProxyFilter};
use std::fmt;

/// A processor that finds pairs, such as a GPU. `pbig-gpu` has one, and `examples/other_device.rs` a small one.
///
/// # What a device promises
///
/// * **Right and complete.** Two valid boxes are a pair if [`Aabb::overlaps`] is true and [`ProxyFilter::allows`] is true. An
///   answer has every pair once, in any order, with `a < b`. There are no partial answers: a device that cannot finish
///   returns [`DeviceFailure::Failed`].
/// * **A failure costs time only.** The CPU then finishes the same call, and [`crate::Report::fallback`] says why. The device
///   is asked again in the next call. A device that was lost may fail at once, or look for another one.
/// * **It comes back.** The caller waits for each call, so a device limits its own waiting.
/// * **It does not panic**, whatever the boxes: they may be invalid ([`Aabb::is_valid`]), infinite, identical or many.
///
/// # What the core promises
///
/// * Ids are indices into [`SearchRequest::boxes`], and each filter belongs to the box of the same index.
/// * Calls do not depend on each other: each has all boxes. A [`crate::BroadPhase`] compares the pairs of an update with those of
///   the last one itself.
/// * The core checks the form of an answer: ids out of range make it a failure. An update drops pairs that are there twice or name an
///   id without a box. The core does not check that pairs overlap or that none is missing.
pub trait PairDevice: fmt::Debug + Send + Sync {
    /// Finds all pairs. `found` is empty, and has the memory of earlier calls.
    ///
    /// # Errors
    /// See [`DeviceFailure`]. Then `found` may hold anything.
    fn find_all(&mut self, request: &SearchRequest<'_>, found: &mut DeviceFound)
    -> Result<(), DeviceFailure>;

    /// Returns a name for reports. None while the device is not open or does not work.
    fn name(&self) -> Option<&str>;

    /// Returns true if the device is known to be a program on the CPU. [`crate::Backend::Auto`] does not use it then.
    fn is_software(&self) -> bool;

    /// Returns a device for a clone of its owner. It may share the processor.
    fn clone_box(&self) -> Box<dyn PairDevice>;
}

impl Clone for Box<dyn PairDevice> {
    fn clone(&self) -> Self {
        self.clone_box()
    }
}

/// A search for all pairs.
#[derive(Clone, Copy, Debug)]
pub struct SearchRequest<'a> {
    /// The boxes, by id. Some may be [`Aabb::NOWHERE`]: ids without a box.
    pub boxes: &'a [Aabb],
    /// Filters by id; none if all boxes may pair.
    pub filters: Option<&'a [ProxyFilter]>,
    /// The caller wants the pairs by `(a, b)`. The core sorts them if the device does not. An update takes them in any order.
    pub is_sorted: bool,
    /// Maximum number of pairs.
    pub max_pairs: u64,
}

/// The answer of a device.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct DeviceFound {
    /// The pairs.
    pub pairs: PairList,
    /// Number of valid boxes.
    pub valid: u32,
    /// The device's plan in words, for [`crate::Plan`]; none if it tested every pair.
    pub plan: Option<String>,
    /// Tests made, as far as the device counts them.
    pub checks: Checks,
    /// Times and counts of the device. The core fills in the name. Kernels whose names begin with `check` count as the stage
    /// `check`, the others as `map`.
    pub report: DeviceReport,
}

/// Reason why a device has no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceFailure {
    /// There are more pairs than [`SearchRequest::max_pairs`]. The call ends in [`crate::Error::TooManyPairs`].
    TooManyPairs,
    /// The device could not do the work, for this reason. The CPU does it.
    Failed(String),
    /// The device works, but the CPU does this call with less work, for this reason. No warning is logged.
    Declined(String),
}
