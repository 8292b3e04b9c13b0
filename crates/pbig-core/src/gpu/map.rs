//! Map and schedule: turn boxes into work items, without a round trip to the host.

use super::GpuError;
use super::commands::{Commands, Groups};
use super::device::GpuDevice;
use super::storage::{BufferId, Storage};
use crate::layout::{CELLS_PER_BLOCK, Cell, Counters, LANES, LargeItem, Located, Params, Slot, SmallItem};
use pbig_shaders::{self as shaders, Buffer};

/// Capacities of the lists whose lengths the device finds out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Capacities {
    /// Lengths of the lists in the last call.
    pub(super) needed: Counters,
}

impl Capacities {
    /// Makes the buffers of the map, and writes the capacities of the lists into `params`.
    pub(super) fn make_buffers(
        &self,
        device: &GpuDevice,
        storage: &mut Storage,
        params: &mut Params,
        first_bytes: u64,
    ) -> Result<(), GpuError> {
        let of = |n: u32, size: usize| u64::from(n) * size as u64;
        storage.ensure_bound(device, Buffer::Located, of(params.boxes, size_of::<Located>()))?;
        storage.ensure_bound(device, Buffer::Cells, of(params.cells, size_of::<Cell>()))?;
        storage.ensure_bound(device, Buffer::Starts, of(params.cells, 4))?;
        storage.ensure_bound(device, Buffer::Sums, of(params.cells.div_ceil(CELLS_PER_BLOCK), 4))?;
        storage.ensure_bound(device, Buffer::Counters, size_of::<Counters>() as u64)?;
        storage.ensure_bound(device, Buffer::Dispatches, 24)?;
        let needed = self.needed;
        let mut list = |buffer, n: u32, size: usize| {
            let bytes = of(n, size).max(first_bytes.min(storage.max_buffer_bytes()));
            storage.ensure_bound(device, buffer, bytes)?;
            let capacity = storage.size(BufferId::Bound(buffer)) / size as u64;
            Ok::<u32, GpuError>(capacity.min(u64::from(u32::MAX)) as u32)
        };
        params.entry_capacity = list(Buffer::Entries, needed.entries, 4)?;
        params.slot_capacity = list(Buffer::Slots, needed.slots, size_of::<Slot>())?;
        params.small_capacity = list(Buffer::SmallItems, needed.small_items, size_of::<SmallItem>())?;
        params.large_capacity = list(Buffer::LargeItems, needed.large_items, size_of::<LargeItem>())?;
        Ok(())
    }

    /// Returns true if all lists fitted into their buffers.
    pub(super) fn sufficed(params: &Params, found: Counters) -> bool {
        found.entries <= params.entry_capacity
            && found.slots <= params.slot_capacity
            && found.small_items <= params.small_capacity
            && found.large_items <= params.large_capacity
    }
}

/// Records all kernels of the map and the schedule.
pub(super) fn record(commands: &mut Commands<'_>, params: &Params) -> Result<(), GpuError> {
    let (cells, counters) = (commands.buffer(Buffer::Cells), commands.buffer(Buffer::Counters));
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
