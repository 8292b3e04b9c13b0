//! Upload: boxes and filters go to the device once. Later calls send only the blocks that changed, or the changes that the
//! caller lists.

use super::ChangeRequest;
use super::GpuError;
use super::storage::Storage;
use crate::layout::{DeviceBox, Motion, Params};
use crate::{Aabb, ProxyFilter};
use bytemuck::{Pod, cast_slice};
use pbig_shaders::Buffer;
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
    /// In place of both lists: the update whose motions the device has, and their number.
    motions: Option<(u64, usize)>,
}

/// Each upload returns the number of boxes that the device then has.
impl UploadCache {
    /// Forgets which motions the device has: the next search for changes uploads all boxes.
    pub(super) fn forget_motions(&mut self) {
        self.motions = None;
    }

    /// Uploads the blocks of boxes and filters that differ from those on the device.
    pub(super) fn upload(
        &mut self,
        storage: &mut Storage,
        boxes: &[Aabb],
        filters: Option<&[ProxyFilter]>,
    ) -> Result<u32, GpuError> {
        self.motions = None;
        send_changed(storage, Buffer::Boxes, &mut self.boxes, boxes, DeviceBox::new)?;
        send_changed(storage, Buffer::Filters, &mut self.filters, filters.unwrap_or(&[]), |filter| *filter)?;
        Ok(boxes.len() as u32)
    }

    /// Uploads boxes now and before, whatever the device has.
    pub(super) fn upload_motions(
        &mut self,
        storage: &mut Storage,
        motions: &[Motion],
        filters: Option<&[ProxyFilter]>,
    ) -> Result<u32, GpuError> {
        // The buffers no longer hold what a search for all pairs has left.
        *self = Self::default();
        storage.upload(Buffer::Boxes, motions)?;
        storage.upload(Buffer::Filters, filters.unwrap_or(&[]))?;
        Ok(motions.len() as u32)
    }

    /// Uploads the changes, or all boxes to a device that does not have those of the last update. `params` gets the
    /// lengths of the lists of changes, which two kernels have yet to apply.
    pub(super) fn upload_changes(
        &mut self,
        storage: &mut Storage,
        request: &ChangeRequest<'_>,
        params: &mut Params,
    ) -> Result<u32, GpuError> {
        let len = request.boxes.len();
        let known = self.motions.filter(|(update, _)| update.checked_add(1) == Some(request.update));
        let (boxes, filters) = (len * size_of::<Motion>(), size_of_val(request.filters));
        let lost_content =
            storage.ensure(Buffer::Boxes, boxes as u64)? | storage.ensure(Buffer::Filters, filters as u64)?;
        match known.filter(|_| !lost_content) {
            Some((_, known)) => send_lists(storage, request, known.min(len), params)?,
            None => _ = self.upload_motions(storage, &request.motions(0..len), Some(request.filters))?,
        }
        self.motions = Some((request.update, len));
        Ok(len as u32)
    }
}

/// Sends the lists of changes of the first `known` boxes, and the boxes after these.
fn send_lists(
    storage: &mut Storage,
    request: &ChangeRequest<'_>,
    known: usize,
    params: &mut Params,
) -> Result<(), GpuError> {
    let (boxes, filters) = request.lists(known);
    storage.upload(Buffer::BoxChanges, &boxes)?;
    storage.upload(Buffer::FilterChanges, &filters)?;
    storage.write(Buffer::Boxes, known, &request.motions(known..request.boxes.len()));
    storage.write(Buffer::Filters, known, &request.filters[known..]);
    params.known = known as u32;
    (params.box_changes, params.filter_changes) = (boxes.len() as u32, filters.len() as u32);
    Ok(())
}

/// Sends the changed blocks of a list, of which the device has `old`.
fn send_changed<T: Pod + Send + Sync, D: Pod + Send>(
    storage: &mut Storage,
    buffer: Buffer,
    old: &mut Vec<T>,
    new: &[T],
    pack: fn(&T) -> D,
) -> Result<(), GpuError> {
    if storage.ensure(buffer, (new.len() * size_of::<D>()) as u64)? {
        old.clear();
    }
    for range in update_copy(old, new) {
        let packed: Vec<D> = new[range.clone()].par_iter().with_min_len(PIECE).map(pack).collect();
        storage.write(buffer, range.start, &packed);
    }
    Ok(())
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
