//! The kernels and buffers of a search, as tables.

use super::error::Result;
use super::storage::Storage;
use super::timer::Timer;
use crate::layout::{
    self, CELLS_PER_BLOCK, COUNTS_PER_BLOCK, Cell, Counters, GROUPS_PER_ROW, LANES, LargeItem, Located,
    Params, SHORT_ROW, Slot, SmallItem, Totals, UNPLANNED, WINDOW,
};
use pbig_core::Pair;
use pbig_shaders::{self as shaders, Buffer, Kernel};
use wgpu::CommandEncoder;

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

/// The steps that begin the counts of a map and of a check anew.
pub(super) const CLEAR_COUNTERS: Step = Clear(Buffer::Counters, size_of::<Counters>() as u64);
const CLEAR_TOTALS: Step = Clear(Buffer::Totals, size_of::<Totals>() as u64);

use Buffer::{Dispatches, LongRows};
use Groups::{Direct, Indirect};
use Step::{Clear, Run};

/// Returns the steps that turn boxes into work items, without a round trip to the host, and check the first chunk of these.
pub(super) fn map_and_check(params: &Params) -> Vec<Step> {
    let by_box = Direct(params.boxes.div_ceil(LANES));
    let map = [
        CLEAR_COUNTERS,
        CLEAR_TOTALS,
        Clear(Buffer::Cells, bytes_of::<Cell>(params.cells)),
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

/// Returns the steps that test every pair (Avril 3.2), or none without a plan that so many boxes need.
pub(super) fn check_all(params: &Params) -> [Step; 2] {
    let is_planned = params.flags & UNPLANNED == 0;
    let groups = if is_planned { pair_count(params.boxes).div_ceil(u64::from(LANES)) } else { 0 };
    [CLEAR_TOTALS, Run(&shaders::CHECK_ALL, Direct(groups as u32))]
}

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
    let mut steps = vec![Run(&shaders::RANK_PAIRS, by_pair(left.min(MOST_RANKED)))];
    if left <= MOST_RANKED {
        steps.extend(
            [&shaders::PLACE_WINDOWS, &shaders::RANK_WINDOWS].map(|it| Run(it, Indirect(LongRows, 0))),
        );
    }
    steps
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
) -> Result<()> {
    let lists = (2 * params.cells).max(params.boxes);
    storage.ensure(Buffer::Located, bytes_of::<Located>(params.boxes))?;
    storage.ensure(Buffer::Cells, bytes_of::<Cell>(params.cells))?;
    storage.ensure(Buffer::Sums, bytes_of::<u32>(lists.div_ceil(COUNTS_PER_BLOCK)))?;
    storage.ensure(Buffer::Dispatches, bytes_of::<[u32; 3]>(2))?;
    let [slot_bytes, item_bytes] = [first_bytes.min(bytes_of::<Slot>(params.cells)), first_bytes / 4];
    params.entry_capacity = make_list::<u32>(storage, Buffer::Entries, needed.entries, first_bytes)?;
    params.slot_capacity = make_list::<Slot>(storage, Buffer::Slots, needed.slots, slot_bytes)?;
    params.small_capacity =
        make_list::<SmallItem>(storage, Buffer::SmallItems, needed.small_items, item_bytes)?;
    params.large_capacity =
        make_list::<LargeItem>(storage, Buffer::LargeItems, needed.large_items, item_bytes)?;
    Ok(())
}

/// Makes a buffer of at least this number of elements, and of at least `first_bytes`. Returns the number of elements that fit.
fn make_list<T>(storage: &mut Storage, buffer: Buffer, needed: u32, first_bytes: u64) -> Result<u32> {
    storage.ensure(buffer, bytes_of::<T>(needed).max(first_bytes))?;
    Ok(u32::try_from(storage.size(buffer) / size_of::<T>() as u64).unwrap_or(u32::MAX))
}

/// Makes the buffers of the sort of this number of pairs.
pub(super) fn make_sort_buffers(storage: &mut Storage, boxes: u32, pairs: u32) -> Result<()> {
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

/// Records steps: first everything that is cleared, then the kernels. They share a pass, unless each is timed.
pub(super) fn record(
    storage: &mut Storage,
    encoder: &mut CommandEncoder,
    steps: &[Step],
    timer: Option<&mut Timer>,
) {
    let mut kernels = Vec::with_capacity(steps.len());
    for &step in steps {
        match step {
            Clear(buffer, bytes) => encoder.clear_buffer(storage.get(buffer), 0, Some(bytes)),
            Run(_, Direct(0)) => {}
            Run(kernel, groups) => kernels.push((kernel, groups)),
        }
    }
    let Some(timer) = timer else { return record_pass(storage, encoder, &kernels, None) };
    for kernel in kernels {
        record_pass(storage, encoder, &[kernel], timer.time(kernel.0));
    }
}

fn record_pass(
    storage: &mut Storage,
    encoder: &mut CommandEncoder,
    kernels: &[(&'static Kernel, Groups)],
    timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
) {
    let descriptor = wgpu::ComputePassDescriptor { label: Some("pbig"), timestamp_writes };
    let mut pass = encoder.begin_compute_pass(&descriptor);
    for &(kernel, groups) in kernels {
        let pipeline = storage.device.pipeline(kernel, storage.options.load_balancing);
        pass.insert_debug_marker(kernel.name);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &storage.bind_group(kernel, &pipeline), &[]);
        match groups {
            Direct(n) => pass.dispatch_workgroups(n.min(GROUPS_PER_ROW), n.div_ceil(GROUPS_PER_ROW), 1),
            Indirect(buffer, at) => pass.dispatch_workgroups_indirect(storage.get(buffer), at),
        }
    }
}
