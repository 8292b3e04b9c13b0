//! Upload: boxes and filters go to the device once. Later calls send only the blocks that changed, or the changes that the
//! caller lists.

use super::ChangeRequest;
use super::GpuError;
use super::commands::{Commands, Groups};
use super::device::GpuDevice;
use super::storage::Storage;
use crate::layout::{DeviceBox, LANES, Motion};
use crate::{Aabb, ProxyFilter};
use bytemuck::{Pod, cast_slice};
use pbig_shaders::{self as shaders, Buffer};
use rayon::prelude::*;
use std::ops::Range;

/// Elements that are compared and sent together. A changed element costs 6 KiB; a million elements are 4096 comparisons of
/// memory.
const BLOCK: usize = 256;

/// Most unchanged blocks between two changed ones that are sent along, to join two transfers.
const MAX_GAP_BLOCKS: usize = 2;

/// Most transfers, each of which allocates. If there would be more, one transfer sends everything in between.
const MAX_RANGES: usize = 32;

/// Fewest elements for a thread: 10 us of work.
pub(super) const PIECE: usize = 1 << 14;

/// The boxes and filters that the device has.
#[derive(Debug, Default)]
pub(super) struct UploadCache {
    boxes: Vec<Aabb>,
    filters: Vec<ProxyFilter>,
    /// In place of both lists: the update whose motions the device has.
    motions: Option<KnownMotions>,
    /// Bytes sent in this call.
    pub(super) bytes_sent: u64,
}

/// An update whose boxes the device has, now and before.
#[derive(Clone, Copy, Debug)]
struct KnownMotions {
    update: u64,
    boxes: usize,
}

/// Uploaded lists of changes, which the kernels `store_previous` and `apply_changes` have yet to apply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PendingChanges {
    /// Number of boxes that the device has.
    pub(super) known: u32,
    /// Length of the list of changed boxes.
    pub(super) boxes: u32,
    /// Length of the list of changed filters.
    pub(super) filters: u32,
}

impl PendingChanges {
    /// Records the kernels that apply the changes.
    pub(super) fn record(self, commands: &mut Commands<'_>) -> Result<(), GpuError> {
        commands.run(&shaders::STORE_PREVIOUS, Groups::Direct(self.known.div_ceil(LANES)))?;
        let longest = self.boxes.max(self.filters);
        commands.run(&shaders::APPLY_CHANGES, Groups::Direct(longest.div_ceil(LANES)))
    }
}

/// Returns true if an update comes right after another.
pub(super) fn follows(before: Option<u64>, update: u64) -> bool {
    before.is_some_and(|before| before.checked_add(1) == Some(update))
}

impl UploadCache {
    /// Forgets which motions the device has: the next search for changes uploads all boxes.
    pub(super) fn forget_motions(&mut self) {
        self.motions = None;
    }

    /// Uploads boxes now and before, whatever the device has.
    pub(super) fn upload_motions(
        &mut self,
        device: &GpuDevice,
        storage: &mut Storage,
        motions: &[Motion],
        filters: Option<&[ProxyFilter]>,
    ) -> Result<(), GpuError> {
        // The buffers no longer hold what a search for all pairs has left.
        self.boxes.clear();
        self.filters.clear();
        self.motions = None;
        storage.ensure_bound(device, Buffer::Boxes, size_of_val(motions) as u64)?;
        self.bytes_sent = write(device, storage, Buffer::Boxes, 0, motions);
        let filters = filters.unwrap_or(&[]);
        storage.ensure_bound(device, Buffer::Filters, size_of_val(filters) as u64)?;
        self.bytes_sent += write(device, storage, Buffer::Filters, 0, filters);
        Ok(())
    }

    /// Uploads the changes, or all boxes to a device that does not have those of the last update.
    pub(super) fn upload_changes(
        &mut self,
        device: &GpuDevice,
        storage: &mut Storage,
        request: &ChangeRequest<'_>,
    ) -> Result<Option<PendingChanges>, GpuError> {
        let len = request.boxes.len();
        let known = self.motions.filter(|known| follows(Some(known.update), request.update));
        let (boxes, filters) = (len * size_of::<Motion>(), size_of_val(request.filters));
        let lost_content = storage.ensure_bound(device, Buffer::Boxes, boxes as u64)?
            | storage.ensure_bound(device, Buffer::Filters, filters as u64)?;
        let pending = match known.filter(|_| !lost_content) {
            Some(known) => Some(self.send_changes(device, storage, request, known.boxes.min(len))?),
            None => {
                let motions = request.motions(0..len);
                self.upload_motions(device, storage, &motions, Some(request.filters))?;
                None
            }
        };
        self.motions = Some(KnownMotions { update: request.update, boxes: len });
        Ok(pending)
    }

    /// Sends the lists of changes of the first `known` boxes, and the boxes after these.
    fn send_changes(
        &mut self,
        device: &GpuDevice,
        storage: &mut Storage,
        request: &ChangeRequest<'_>,
        known: usize,
    ) -> Result<PendingChanges, GpuError> {
        let (boxes, filters) = request.lists(known);
        storage.ensure_bound(device, Buffer::BoxChanges, size_of_val(&boxes[..]) as u64)?;
        storage.ensure_bound(device, Buffer::FilterChanges, size_of_val(&filters[..]) as u64)?;
        let new = request.motions(known..request.boxes.len());
        self.bytes_sent = write(device, storage, Buffer::BoxChanges, 0, &boxes)
            + write(device, storage, Buffer::FilterChanges, 0, &filters)
            + write(device, storage, Buffer::Boxes, known, &new)
            + write(device, storage, Buffer::Filters, known, &request.filters[known..]);
        let (boxes, filters) = (boxes.len() as u32, filters.len() as u32);
        Ok(PendingChanges { known: known as u32, boxes, filters })
    }

    /// Uploads the blocks of boxes and filters that differ from those on the device.
    pub(super) fn upload(
        &mut self,
        device: &GpuDevice,
        storage: &mut Storage,
        boxes: &[Aabb],
        filters: Option<&[ProxyFilter]>,
    ) -> Result<(), GpuError> {
        self.bytes_sent = 0;
        self.motions = None;
        if storage.ensure_bound(device, Buffer::Boxes, size_of_val(boxes) as u64)? {
            self.boxes.clear();
        }
        for range in update_copy(&mut self.boxes, boxes) {
            let packed = boxes[range.clone()].par_iter().with_min_len(PIECE).map(DeviceBox::new);
            let packed: Vec<DeviceBox> = packed.collect();
            self.bytes_sent += write(device, storage, Buffer::Boxes, range.start, &packed);
        }
        let filters = filters.unwrap_or(&[]);
        if storage.ensure_bound(device, Buffer::Filters, size_of_val(filters) as u64)? {
            self.filters.clear();
        }
        for range in update_copy(&mut self.filters, filters) {
            let changed = &filters[range.clone()];
            self.bytes_sent += write(device, storage, Buffer::Filters, range.start, changed);
        }
        Ok(())
    }
}

/// Writes elements into a buffer, from the element `start` on. Returns the bytes sent.
fn write<T: Pod>(device: &GpuDevice, storage: &Storage, buffer: Buffer, start: usize, data: &[T]) -> u64 {
    device.queue.write_buffer(storage.bound(buffer), (start * size_of::<T>()) as u64, cast_slice(data));
    size_of_val(data) as u64
}

/// Makes `old` equal to `new`, and returns the ranges of `new` that differed. Changed blocks near each other are one range.
///
/// Elements are compared bit by bit, so a NaN equals itself. If `old` is longer, its rest stays: the device knows how many
/// elements count.
fn update_copy<T: Pod + Send + Sync>(old: &mut Vec<T>, new: &[T]) -> Vec<Range<usize>> {
    let known = old.len();
    old.extend_from_slice(new.get(known..).unwrap_or(&[]));
    let update = |(i, (old, new)): (usize, (&mut [T], &[T]))| {
        let bytes = cast_slice::<T, u8>;
        let differs = i * BLOCK + new.len() > known || bytes(&old[..new.len()]) != bytes(new);
        if differs {
            old[..new.len()].copy_from_slice(new);
        }
        differs
    };
    let blocks = old.par_chunks_mut(BLOCK).zip(new.par_chunks(BLOCK)).enumerate();
    let differs: Vec<bool> = blocks.with_min_len(PIECE / BLOCK).map(update).collect();
    ranges(&differs, new.len())
}

/// Returns the ranges of elements of the blocks that differ.
fn ranges(differs: &[bool], len: usize) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (i, _) in differs.iter().enumerate().filter(|(_, differs)| **differs) {
        let (start, end) = (i * BLOCK, len.min((i + 1) * BLOCK));
        match ranges.last_mut() {
            Some(last) if last.end + MAX_GAP_BLOCKS * BLOCK >= start => last.end = end,
            _ => ranges.push(start..end),
        }
    }
    if ranges.len() > MAX_RANGES {
        let end = ranges.last().map_or(0, |last| last.end);
        ranges.truncate(1);
        ranges[0].end = end;
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns start and end of each range.
    fn sent<T: Pod + Send + Sync>(old: &mut Vec<T>, new: &[T]) -> Vec<(usize, usize)> {
        update_copy(old, new).into_iter().map(|range| (range.start, range.end)).collect()
    }

    #[test]
    fn only_changed_blocks_are_sent() {
        let mut new = vec![0u32; 10 * BLOCK + 7];
        let mut old = Vec::new();
        assert_eq!(sent(&mut old, &new), [(0, new.len())]);
        assert_eq!(sent(&mut old, &new), []);
        new[3 * BLOCK] = 1;
        new[4 * BLOCK + 9] = 1;
        new[10 * BLOCK + 6] = 1;
        assert_eq!(sent(&mut old, &new), [(3 * BLOCK, 5 * BLOCK), (10 * BLOCK, 10 * BLOCK + 7)]);
        // The list shrinks, then grows again over old elements.
        assert_eq!(sent(&mut old, &new[..BLOCK]), []);
        new[2 * BLOCK] = 5;
        assert_eq!(sent(&mut old, &new), [(2 * BLOCK, 3 * BLOCK)]);
        assert_eq!(old, new);
        let nan = [f32::NAN; 3];
        let mut old = nan.to_vec();
        assert_eq!(sent(&mut old, &nan), []);
    }
}
