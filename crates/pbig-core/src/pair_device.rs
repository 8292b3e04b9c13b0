//! The door for other processors: a [`PairDevice`] finds pairs for a [`crate::Finder`] or a [`crate::BroadPhase`].

use crate::{Aabb, Checks, DeviceReport, Pair, ProxyFilter};
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
/// * Between two calls of [`PairDevice::find_changed`] without [`PairDevice::forget`], nothing has changed but the boxes in
///   [`ChangeRequest::changed`] and new ids. So a device may keep the boxes of the last update and be sent the changes alone.
/// * The core checks the form of an answer: ids out of range make it a failure, only a new pair can begin, and only a kept
///   one can end. It does not check that pairs overlap or that none is missing.
pub trait PairDevice: fmt::Debug + Send + Sync {
    /// Finds all pairs. `found` is empty, and has the memory of earlier calls.
    ///
    /// # Errors
    /// See [`DeviceFailure`]. Then `found` may hold anything.
    fn find_all(&mut self, request: &SearchRequest<'_>, found: &mut DeviceFound)
    -> Result<(), DeviceFailure>;

    /// Finds the pairs that an update has changed: those that have begun since the last update ([`DeviceFound::pairs`]), and
    /// those that have ended ([`DeviceFound::ended`]). Without an earlier update there were no boxes.
    ///
    /// # Errors
    /// As [`PairDevice::find_all`].
    fn find_changed(
        &mut self,
        request: &ChangeRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure>;

    /// Forgets the boxes of the last update: the CPU has done an update, or an update has failed and will be repeated.
    fn forget(&mut self);

    /// Returns a name for reports. None while the device is not open or does not work.
    fn name(&self) -> Option<&str>;

    /// Returns true if the device is known to be a program on the CPU. [`crate::Backend::Auto`] does not use it then.
    fn is_software(&self) -> bool;

    /// Returns a device for a clone of its owner. It may share the processor, but not the boxes of the last update.
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
    /// The boxes, by id.
    pub boxes: &'a [Aabb],
    /// Filters by id; none if all boxes may pair.
    pub filters: Option<&'a [ProxyFilter]>,
    /// The caller wants the pairs by `(a, b)`. The core sorts them if the device does not.
    pub is_sorted: bool,
    /// Maximum number of pairs.
    pub max_pairs: u64,
}

/// An update.
#[derive(Clone, Copy, Debug)]
pub struct ChangeRequest<'a> {
    /// The boxes now, by id; [`Aabb::NOWHERE`] where there is none.
    pub boxes: &'a [Aabb],
    /// The filters now, by id.
    pub filters: &'a [ProxyFilter],
    /// The changed boxes, each once. All others are as at the last update; new ids were absent.
    pub changed: &'a [ChangedBox],
    /// Number of pairs at the last update.
    pub kept: u64,
    /// Maximum number of added and ended pairs beyond `kept`.
    pub max_pairs: u64,
}

/// A changed box as it was at the last update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangedBox {
    /// Id of the box.
    pub id: u32,
    /// The box at the last update. [`Aabb::NOWHERE`] if it was absent, or if its pairs have ended already.
    pub aabb: Aabb,
    /// The filter at the last update.
    pub filter: ProxyFilter,
}

/// The answer of a device.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct DeviceFound {
    /// The pairs; of an update, the added ones.
    pub pairs: Vec<Pair>,
    /// Pairs that an update has ended.
    pub ended: Vec<Pair>,
    /// Ids of changed boxes that the device treats as absent at the last update, ascending. All their pairs
    /// are in `pairs`, and none is in `ended`: the core finds those that have ended.
    pub restarted: Vec<u32>,
    /// Number of valid boxes; of an update, of boxes that are valid now or were at the last update.
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
    /// There are more pairs than [`SearchRequest::max_pairs`], or more changes than [`ChangeRequest::max_pairs`] allows. The call
    /// ends in [`crate::Error::TooManyPairs`].
    TooManyPairs,
    /// The device could not do the work, for this reason. The CPU does it.
    Failed(String),
    /// The device works, but the CPU does this call with less work, for this reason. No warning is logged.
    Declined(String),
}
