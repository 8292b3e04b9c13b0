//! Map and schedule: from boxes to work items, without a round trip to the host.

use super::GpuError;
use super::commands::{Commands, Groups};
use super::engine::Engine;
use super::storage::Storage;
use crate::layout::{CELLS_PER_BLOCK, Cell, Counters, LANES, LargeItem, Located, Params, Slot, SmallItem};
use pbig_shaders as shaders;

/// How much room the lists get whose length only the device finds out; what the last call needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Room {
    pub(super) needed: Counters,
}

impl Room {
    /// Makes room, and says in `params` how much there is.
    pub(super) fn make(
        &self,
        engine: &Engine,
        storage: &mut Storage,
        params: &mut Params,
        first_bytes: u64,
    ) -> Result<(), GpuError> {
        let of = |n: u32, size: usize| u64::from(n) * size as u64;
        storage.ensure(engine, "located", of(params.boxes, size_of::<Located>()))?;
        storage.ensure(engine, "cells", of(params.cells, size_of::<Cell>()))?;
        storage.ensure(engine, "starts", of(params.cells, 4))?;
        storage.ensure(engine, "sums", of(params.cells.div_ceil(CELLS_PER_BLOCK), 4))?;
        storage.ensure(engine, "counters", size_of::<Counters>() as u64)?;
        storage.ensure(engine, "dispatches", 24)?;
        let needed = self.needed;
        let mut list = |name, n: u32, size: usize| {
            let bytes = of(n, size).max(first_bytes.min(storage.most_bytes()));
            storage.ensure(engine, name, bytes)?;
            Ok::<u32, GpuError>((storage.size(name) / size as u64).min(u64::from(u32::MAX)) as u32)
        };
        params.entry_room = list("entries", needed.entries, 4)?;
        params.slot_room = list("slots", needed.slots, size_of::<Slot>())?;
        params.small_room = list("small_items", needed.small_items, size_of::<SmallItem>())?;
        params.large_room = list("large_items", needed.large_items, size_of::<LargeItem>())?;
        Ok(())
    }

    /// Whether all that was found had room.
    pub(super) fn held(params: &Params, found: Counters) -> bool {
        found.entries <= params.entry_room
            && found.slots <= params.slot_room
            && found.small_items <= params.small_room
            && found.large_items <= params.large_room
    }
}

/// Records all kernels of the map and the schedule.
pub(super) fn record(commands: &mut Commands<'_>, params: &Params) -> Result<(), GpuError> {
    let (cells, counters) = (commands.storage.get("cells"), commands.storage.get("counters"));
    let used = u64::from(params.cells) * size_of::<Cell>() as u64;
    commands.encoder.clear_buffer(cells, 0, Some(used));
    commands.encoder.clear_buffer(counters, 0, None);
    let by_box = Groups::Direct(params.boxes.div_ceil(LANES));
    let by_cell = Groups::Direct(params.cells.div_ceil(LANES));
    let by_block = Groups::Direct(params.cells.div_ceil(CELLS_PER_BLOCK));
    commands.run(&shaders::LOCATE, by_box)?;
    if params.levels > 1 {
        commands.run(&shaders::VISIT, by_box)?;
    }
    commands.run(&shaders::SCAN_BLOCKS, by_block)?;
    commands.run(&shaders::SCAN_SUMS, Groups::Direct(1))?;
    commands.run(&shaders::SCAN_ADD, by_cell)?;
    commands.run(&shaders::SCHEDULE, by_block)?;
    commands.run(&shaders::SCATTER, by_box)?;
    commands.run(&shaders::ARRANGE, Groups::Direct(1))
}
