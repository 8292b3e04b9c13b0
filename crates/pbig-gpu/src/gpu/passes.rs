//! The kernels and buffers of a search, as tables.

use super::GpuError;
use super::storage::Storage;
use super::timer::Timer;
use crate::layout::{
    self, CELLS_PER_BLOCK, COUNTS_PER_BLOCK, Cell, Counters, GROUPS_PER_ROW, LANES, LargeItem, Located,
    Params, SHORT_ROW, Slot, SmallItem, Totals, WINDOW,
};
use pbig_core::Pair;
use pbig_shaders::{self as shaders, Buffer, Kernel};

/// The number of workgroups of a kernel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Groups {
    /// A number that the host knows. 0 leaves the kernel out.
    Direct(u32),
    /// A number that the device has written into a buffer, at this byte.
    Indirect(Buffer, u64),
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// Sets the first bytes of a buffer to 0.
    Clear(Buffer, u64),
    Run(&'static Kernel, Groups),
}

/// The step that begins the counts of a check anew.
pub(super) const CLEAR_TOTALS: Step = Clear(Buffer::Totals, size_of::<Totals>() as u64);

use Buffer::{Dispatches, LongRows};
use Groups::{Direct, Indirect};
use Step::{Clear, Run};

/// Returns the steps that turn boxes into work items, without a round trip to the host, and check the first chunk of these.
pub(super) fn map_and_check(params: &Params) -> Vec<Step> {
    let by_box = Direct(params.boxes.div_ceil(LANES));
    let map = [
        CLEAR_TOTALS,
        Clear(Buffer::Cells, bytes_of::<Cell>(params.cells)),
        Clear(Buffer::Counters, bytes_of::<Counters>(1)),
        Run(&shaders::LOCATE, by_box),
        Run(&shaders::VISIT, if params.levels > 1 { by_box } else { Direct(0) }),
        Run(&shaders::SCAN_BLOCKS, Direct((2 * params.cells).div_ceil(COUNTS_PER_BLOCK))),
        Run(&shaders::SCAN_SUMS, Direct(1)),
        Run(&shaders::SCHEDULE, Direct(params.cells.div_ceil(CELLS_PER_BLOCK))),
        Run(&shaders::SCATTER, by_box),
    ];
    [&map[..], &check()].concat()
}

/// Returns the steps that check a chunk of the work items, whose number the device knows.
pub(super) fn check() -> [Step; 3] {
    [
        Run(&shaders::ARRANGE, Direct(1)),
        Run(&shaders::CHECK_SMALL, Indirect(Dispatches, 0)),
        Run(&shaders::CHECK_LARGE, Indirect(Dispatches, 12)),
    ]
}

/// Returns the steps that test every pair (Avril 3.2).
pub(super) fn check_all(params: &Params) -> [Step; 2] {
    let groups = pair_count(params.boxes).div_ceil(u64::from(LANES));
    [CLEAR_TOTALS, Run(&shaders::CHECK_ALL, Direct(groups as u32))]
}

/// Returns the number of pairs of this number of boxes.
pub(super) fn pair_count(boxes: u32) -> u64 {
    u64::from(boxes) * u64::from(boxes.saturating_sub(1)) / 2
}

/// Returns the steps that group this number of pairs by first box. Their work is a few steps a pair.
pub(super) fn group(boxes: u32, pairs: u32) -> [Step; 6] {
    let [scan_blocks, scan_sums] = shaders::SCAN_OF_ROWS;
    [
        Clear(Buffer::Rows, bytes_of::<u32>(boxes)),
        Clear(Buffer::Windows, windows_bytes(boxes, pairs)),
        Run(&shaders::COUNT_PAIRS, by_pair(pairs)),
        Run(scan_blocks, Direct(boxes.div_ceil(COUNTS_PER_BLOCK))),
        Run(scan_sums, Direct(1)),
        Run(&shaders::PLACE_PAIRS, by_pair(pairs)),
    ]
}

fn by_pair(pairs: u32) -> Groups {
    Direct(pairs.div_ceil(LANES))
}

/// Maximum number of pairs that one dispatch ranks. It reads up to [`SHORT_ROW`] others for each: two billion in all.
pub(super) const MOST_RANKED: u32 = 1 << 22;
const _: () = assert!(MOST_RANKED as u64 * SHORT_ROW as u64 <= 1 << 31, "as many as the tests of a dispatch");

/// Returns the steps that order the next grouped pairs in their rows, of this number that are left, and long rows if these pairs are the
/// last.
pub(super) fn rank(left: u32) -> Vec<Step> {
    let long_rows =
        [&shaders::PLACE_WINDOWS, &shaders::RANK_WINDOWS].map(|it| Run(it, Indirect(LongRows, 0)));
    let steps = [Run(&shaders::RANK_PAIRS, by_pair(left.min(MOST_RANKED)))].into_iter();
    steps.chain(long_rows.into_iter().filter(|_| left <= MOST_RANKED)).collect()
}

fn bytes_of<T>(elements: u32) -> u64 {
    u64::from(elements) * size_of::<T>() as u64
}

/// Makes the buffers of the map. The device finds out the lengths of the lists: `needed` has those of the last call, and
/// `params` gets the capacities.
pub(super) fn make_buffers(
    storage: &mut Storage,
    params: &mut Params,
    needed: &Counters,
    first_bytes: u64,
) -> Result<(), GpuError> {
    let lists = (2 * params.cells).max(params.boxes);
    let buffers = [
        (Buffer::Located, bytes_of::<Located>(params.boxes)),
        (Buffer::Cells, bytes_of::<Cell>(params.cells)),
        (Buffer::Sums, bytes_of::<u32>(lists.div_ceil(COUNTS_PER_BLOCK))),
        (Buffer::Dispatches, bytes_of::<[u32; 3]>(2)),
    ];
    for (buffer, bytes) in buffers {
        storage.ensure(buffer, bytes)?;
    }
    let slot_bytes = first_bytes.min(bytes_of::<Slot>(params.cells));
    let [entry, slot, small, large] =
        [size_of::<u32>(), size_of::<Slot>(), size_of::<SmallItem>(), size_of::<LargeItem>()];
    let lists = [
        (Buffer::Entries, needed.entries, entry, &mut params.entry_capacity, first_bytes),
        (Buffer::Slots, needed.slots, slot, &mut params.slot_capacity, slot_bytes),
        (Buffer::SmallItems, needed.small_items, small, &mut params.small_capacity, first_bytes / 4),
        (Buffer::LargeItems, needed.large_items, large, &mut params.large_capacity, first_bytes / 4),
    ];
    for (buffer, len, size, capacity, first_bytes) in lists {
        let bytes = u64::from(len) * size as u64;
        storage.ensure(buffer, bytes.max(first_bytes.min(storage.max_buffer_bytes)))?;
        *capacity = u32::try_from(storage.size(buffer) / size as u64).unwrap_or(u32::MAX);
    }
    Ok(())
}

/// Makes the buffers of the sort of this number of pairs.
pub(super) fn make_sort_buffers(storage: &mut Storage, boxes: u32, pairs: u32) -> Result<(), GpuError> {
    storage.ensure(Buffer::Rows, bytes_of::<u32>(boxes))?;
    storage.ensure(Buffer::Grouped, bytes_of::<Pair>(pairs))?;
    storage.ensure(Buffer::Windows, windows_bytes(boxes, pairs))?;
    storage.ensure(LongRows, 4 * (u64::from(layout::FIRST_PIECE) + 3 * most_long_rows(pairs)))?;
    // An indirect dispatch of no workgroups, and no piece: `rank_pairs` adds them.
    storage.write(LongRows, &[0, 0, 1, 0])
}

/// Returns the maximum number of long rows of this number of pairs, which is also that of their pieces.
fn most_long_rows(pairs: u32) -> u64 {
    u64::from(pairs / SHORT_ROW) + 1
}

/// Returns the bytes of the counters of the windows of long rows.
fn windows_bytes(boxes: u32, pairs: u32) -> u64 {
    4 * most_long_rows(pairs) * u64::from(boxes.div_ceil(WINDOW))
}

/// Returns true if all lists of the map fitted into their buffers.
pub(super) fn lists_fit(params: &Params, found: &Counters) -> bool {
    found.entries <= params.entry_capacity
        && found.slots <= params.slot_capacity
        && found.small_items <= params.small_capacity
        && found.large_items <= params.large_capacity
}

/// Returns true if the work items need no more tests than the plan promised.
pub(super) fn tests_fit(params: &Params, found: &Counters) -> bool {
    found.tests <= params.most_tests && found.too_many_tests == 0
}

/// A submission that is being recorded.
pub(super) struct Recording<'a> {
    pub(super) storage: &'a mut Storage,
    pub(super) encoder: &'a mut wgpu::CommandEncoder,
    /// See [`crate::GpuOptions::load_balancing`].
    pub(super) is_balanced: bool,
    pub(super) timer: Option<&'a mut Timer>,
}

impl Recording<'_> {
    /// Records steps: first everything that is cleared, then the kernels. They share a pass, unless each is timed.
    pub(super) fn record(mut self, steps: &[Step]) {
        let mut kernels = Vec::with_capacity(steps.len());
        for &step in steps {
            match step {
                Clear(buffer, bytes) => {
                    self.encoder.clear_buffer(self.storage.get(buffer), 0, Some(bytes));
                }
                Run(_, Direct(0)) => {}
                Run(kernel, groups) => kernels.push((kernel, groups)),
            }
        }
        let Some(timer) = self.timer.take() else {
            return self.run(&kernels, None);
        };
        for kernel in kernels {
            self.run(&[kernel], timer.time(kernel.0));
        }
    }

    /// Records a pass.
    fn run(
        &mut self,
        kernels: &[(&'static Kernel, Groups)],
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        let descriptor = wgpu::ComputePassDescriptor { label: Some("pbig"), timestamp_writes };
        let mut pass = self.encoder.begin_compute_pass(&descriptor);
        for &(kernel, groups) in kernels {
            let pipeline = self.storage.device.pipeline(kernel, self.is_balanced);
            pass.insert_debug_marker(kernel.name);
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &self.storage.bind_group(kernel, &pipeline), &[]);
            match groups {
                Direct(n) => pass.dispatch_workgroups(n.min(GROUPS_PER_ROW), n.div_ceil(GROUPS_PER_ROW), 1),
                Indirect(buffer, at) => pass.dispatch_workgroups_indirect(self.storage.get(buffer), at),
            }
        }
    }
}
