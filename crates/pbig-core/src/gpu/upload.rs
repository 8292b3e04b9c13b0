//! Upload: boxes and filters go to the device once; later calls send only the blocks that changed, or the
//! changes that they are given.

use super::ChangeRequest;
use super::GpuError;
use super::commands::{Commands, Groups};
use super::engine::Engine;
use super::storage::Storage;
use crate::layout::{Box as DeviceBox, LANES, Motion, Move, Refilter};
use crate::{Aabb, ProxyFilter};
use bytemuck::{Pod, cast_slice};
use pbig_shaders as shaders;
use rayon::prelude::*;
use std::ops::Range;

/// Elements that are sent together: one that changed costs 6 KiB, and a million are 4096 comparisons
/// of memory.
const BLOCK: usize = 256;

/// Blocks in between that are sent along rather than split a transfer.
const GAP: usize = 2;

/// Transfers, an allocation each, beyond which all in between is sent along.
const MOST_RANGES: usize = 32;

/// Elements that are worth another thread: 10 us of work.
pub(super) const PIECE: usize = 1 << 14;

/// What the device has.
#[derive(Debug)]
pub(super) struct Mirror {
    boxes: Vec<Aabb>,
    filters: Vec<ProxyFilter>,
    /// In place of both, after a search for changes of all boxes at once.
    motions: Option<Known>,
    /// Bytes sent in this call.
    pub(super) sent: u64,
}

/// Boxes, now and before, that the device has as an update has left them.
#[derive(Clone, Copy, Debug)]
struct Known {
    update: u64,
    boxes: usize,
}

/// What the device has been sent of boxes that it knows, for `settle` and `renew` to take in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct News {
    pub(super) known: u32,
    pub(super) moves: u32,
    pub(super) refilters: u32,
}

impl News {
    /// What boxes are becomes what they were, then the changed ones become what they are.
    pub(super) fn record(self, commands: &mut Commands<'_>) -> Result<(), GpuError> {
        commands.run(&shaders::SETTLE, Groups::Direct(self.known.div_ceil(LANES)))?;
        let changes = self.moves.max(self.refilters);
        commands.run(&shaders::RENEW, Groups::Direct(changes.div_ceil(LANES)))
    }
}

/// Whether an update is the one after another.
pub(super) fn follows(before: Option<u64>, update: u64) -> bool {
    before.is_some_and(|before| before.checked_add(1) == Some(update))
}

impl Mirror {
    pub(super) fn new() -> Self {
        Self { boxes: Vec::new(), filters: Vec::new(), motions: None, sent: 0 }
    }

    /// The device's motions are no longer what an update has left.
    pub(super) fn forget_motions(&mut self) {
        self.motions = None;
    }

    /// Sends boxes as they are and were, whatever the device has.
    pub(super) fn upload_motions(
        &mut self,
        engine: &Engine,
        storage: &mut Storage,
        motions: &[Motion],
        filters: Option<&[ProxyFilter]>,
    ) -> Result<(), GpuError> {
        self.replace_boxes();
        storage.ensure(engine, "boxes", size_of_val(motions) as u64)?;
        self.sent = write(engine, storage.get("boxes"), 0, motions);
        let filters = filters.unwrap_or(&[]);
        storage.ensure(engine, "filters", size_of_val(filters) as u64)?;
        self.sent += write(engine, storage.get("filters"), 0, filters);
        Ok(())
    }

    /// Sends what has changed, or everything to a device that does not know the update before.
    pub(super) fn upload_changes(
        &mut self,
        engine: &Engine,
        storage: &mut Storage,
        request: &ChangeRequest<'_>,
    ) -> Result<Option<News>, GpuError> {
        let len = request.boxes.len();
        let known = self.motions.filter(|known| follows(Some(known.update), request.update));
        let room = (len * size_of::<Motion>()) as u64;
        let renewed = storage.ensure(engine, "boxes", room)?
            | storage.ensure(engine, "filters", size_of_val(request.filters) as u64)?;
        let news = match known.filter(|_| !renewed) {
            Some(known) => Some(self.send_changes(engine, storage, request, known.boxes.min(len))?),
            None => {
                let motions = request.motions(0..len);
                self.upload_motions(engine, storage, &motions, Some(request.filters))?;
                None
            }
        };
        self.motions = Some(Known { update: request.update, boxes: len });
        Ok(news)
    }

    /// Lists of what has changed, and the boxes that are new at the end.
    fn send_changes(
        &mut self,
        engine: &Engine,
        storage: &mut Storage,
        request: &ChangeRequest<'_>,
        known: usize,
    ) -> Result<News, GpuError> {
        let (moves, refilters) = request.lists(known);
        storage.ensure(engine, "moves", size_of_val(&moves[..]) as u64)?;
        storage.ensure(engine, "refilters", size_of_val(&refilters[..]) as u64)?;
        let at_end = request.motions(known..request.boxes.len());
        self.sent = write::<Move>(engine, storage.get("moves"), 0, &moves)
            + write::<Refilter>(engine, storage.get("refilters"), 0, &refilters)
            + write(engine, storage.get("boxes"), known, &at_end)
            + write(engine, storage.get("filters"), known, &request.filters[known..]);
        Ok(News { known: known as u32, moves: moves.len() as u32, refilters: refilters.len() as u32 })
    }

    /// What is known of the device's boxes and filters is about to be wrong.
    fn replace_boxes(&mut self) {
        self.boxes.clear();
        self.filters.clear();
        self.motions = None;
    }

    /// Brings the device's boxes, and filters if there are any, up to date.
    pub(super) fn upload(
        &mut self,
        engine: &Engine,
        storage: &mut Storage,
        boxes: &[Aabb],
        filters: Option<&[ProxyFilter]>,
    ) -> Result<(), GpuError> {
        self.sent = 0;
        self.motions = None;
        if storage.ensure(engine, "boxes", size_of_val(boxes) as u64)? {
            self.boxes.clear();
        }
        for range in changed(&mut self.boxes, boxes) {
            let packed = boxes[range.clone()].par_iter().with_min_len(PIECE).map(DeviceBox::new);
            let packed: Vec<DeviceBox> = packed.collect();
            self.sent += write(engine, storage.get("boxes"), range.start, &packed);
        }
        let filters = filters.unwrap_or(&[]);
        if storage.ensure(engine, "filters", size_of_val(filters) as u64)? {
            self.filters.clear();
        }
        for range in changed(&mut self.filters, filters) {
            self.sent += write(engine, storage.get("filters"), range.start, &filters[range.clone()]);
        }
        Ok(())
    }
}

fn write<T: Pod>(engine: &Engine, buffer: &wgpu::Buffer, start: usize, data: &[T]) -> u64 {
    engine.queue.write_buffer(buffer, (start * size_of::<T>()) as u64, cast_slice(data));
    size_of_val(data) as u64
}

/// Makes `old` equal to `new` and returns the ranges of `new` that differed, bit by bit: a NaN is
/// equal to itself. Blocks that changed near each other are one range. What `new` no longer has stays:
/// the device is told how many elements count.
fn changed<T: Pod + Send + Sync>(old: &mut Vec<T>, new: &[T]) -> Vec<Range<usize>> {
    let known = old.len();
    old.extend_from_slice(new.get(known..).unwrap_or(&[]));
    let renew = |(i, (old, new)): (usize, (&mut [T], &[T]))| {
        let bytes = cast_slice::<T, u8>;
        let differs = i * BLOCK + new.len() > known || bytes(&old[..new.len()]) != bytes(new);
        if differs {
            old[..new.len()].copy_from_slice(new);
        }
        differs
    };
    let blocks = old.par_chunks_mut(BLOCK).zip(new.par_chunks(BLOCK)).enumerate();
    let differs: Vec<bool> = blocks.with_min_len(PIECE / BLOCK).map(renew).collect();
    ranges(&differs, new.len())
}

fn ranges(differs: &[bool], len: usize) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (i, _) in differs.iter().enumerate().filter(|(_, differs)| **differs) {
        let (start, end) = (i * BLOCK, len.min((i + 1) * BLOCK));
        match ranges.last_mut() {
            Some(last) if last.end + GAP * BLOCK >= start => last.end = end,
            _ => ranges.push(start..end),
        }
    }
    if ranges.len() > MOST_RANGES {
        let end = ranges.last().map_or(0, |last| last.end);
        ranges.truncate(1);
        ranges[0].end = end;
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Start and end of each range.
    fn sent<T: Pod + Send + Sync>(old: &mut Vec<T>, new: &[T]) -> Vec<(usize, usize)> {
        changed(old, new).into_iter().map(|range| (range.start, range.end)).collect()
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
        // Shrunk, then grown again over what had been there.
        assert_eq!(sent(&mut old, &new[..BLOCK]), []);
        new[2 * BLOCK] = 5;
        assert_eq!(sent(&mut old, &new), [(2 * BLOCK, 3 * BLOCK)]);
        assert_eq!(old, new);
        let nan = [f32::NAN; 3];
        let mut old = nan.to_vec();
        assert_eq!(sent(&mut old, &nan), []);
    }
}
