//! The engine on a device: only what has changed goes there, only pairs that were added or removed come back.

use super::Task;
use crate::broad_phase::world::World;
use crate::device_slot::DeviceSlot;
use crate::holder::Holder;
use crate::outcome::{End, Outcome};
use crate::parallel::{self, SharedSlice};
use crate::{Aabb, ChangeRequest, ChangedBox, DeviceFound, Pair, PairDevice, ProxyFilter};

/// Changed boxes, or pairs, that a thread takes at a time.
const PIECE: usize = 1 << 14;

/// Leaves the events of an update in the task. Gives up if the device cannot do the work.
pub(crate) fn run(slot: &mut DeviceSlot, task: &mut Task<'_>) -> Outcome {
    if task.holder != Holder::Device {
        slot.forget();
    }
    let mut list = std::mem::take(&mut slot.changed);
    let changed = changed_boxes(task.world, &mut list);
    let World { boxes, filters, .. } = task.world;
    let (kept, max_pairs) = (task.kept.len() as u64, task.config.limits.pairs());
    let request = ChangeRequest { boxes, filters, changed, kept, max_pairs };
    let call = |device: &mut dyn PairDevice, found: &mut _| device.find_changed(&request, found);
    let (mut outcome, found) = slot.call(boxes.len(), Vec::new(), call);
    slot.changed = list;
    if outcome.end == End::Done {
        outcome.holder = Holder::Device;
        sort_out(&found, task);
    } else {
        outcome.plan.boxes = task.world.valid;
        // The structure on the CPU is untouched, so the next update may go on with it.
        outcome.holder = if task.holder == Holder::Device { Holder::Nothing } else { task.holder };
    }
    outcome
}

/// Writes the changed boxes, as they were at the last update, to the start of a list, which keeps its memory. Returns them.
fn changed_boxes<'a>(world: &World, list: &'a mut Vec<ChangedBox>) -> &'a [ChangedBox] {
    const NONE: ChangedBox = ChangedBox { id: 0, aabb: Aabb::NOWHERE, filter: ProxyFilter::ALL };
    let changed = world.changed.len();
    parallel::ensure_scratch(list, changed, NONE);
    let (shared, pieces) = (SharedSlice::new(&mut list[..changed]), changed.div_ceil(PIECE));
    parallel::run(parallel::threads_for(pieces), pieces, |_, piece| {
        for i in parallel::piece_range(changed, piece, pieces) {
            let (id, old) = (world.changed[i], &world.old[i]);
            let aabb = if world.was_removed(id) { Aabb::NOWHERE } else { old.aabb };
            // SAFETY: the list outlives the call, and each place belongs to one piece.
            unsafe { shared.write(i, ChangedBox { id, aabb, filter: old.filter }) };
        }
    });
    &list[..changed]
}

/// Appends the pairs that `choose` takes out of some of them, which a thread hands it at a time.
fn select(pairs: &[Pair], chosen: &mut Vec<Pair>, choose: impl Fn(&[Pair]) -> Vec<Pair> + Sync) {
    let pieces: Vec<&[Pair]> = pairs.chunks(PIECE).collect();
    for piece in parallel::map(pieces.len(), |i| choose(pieces[i])) {
        chosen.extend(piece);
    }
}

/// Sorts what a device has found into added, removed and dropped pairs.
fn sort_out(found: &DeviceFound, task: &mut Task<'_>) {
    let Task { world, kept, events, .. } = task;
    events.clear();
    let was_removed = |pair: &Pair| world.was_removed(pair.a) || world.was_removed(pair.b);
    let existed = |pair: &Pair| !(world.has_removed() && was_removed(pair));
    // A pair that is not kept cannot end, and a kept one cannot begin: a device that says so is wrong, and does no harm. A device
    // reports all pairs of a box that it treats as new.
    let ends = |(pair, is_kept): (Pair, bool)| (is_kept && existed(&pair)).then_some(pair);
    let begins = |(pair, is_kept): (Pair, bool)| (!is_kept || !existed(&pair)).then_some(pair);
    select(&found.ended, &mut events.removed, |pairs| kept.look_up(pairs).filter_map(ends).collect());
    select(&found.pairs, &mut events.added, |pairs| kept.look_up(pairs).filter_map(begins).collect());
    for &id in &world.removed {
        events.dropped.extend(kept.partners(id).map(|other| Pair::new(id, other)));
    }
    let overlaps = |pair: &Pair| world.boxes[pair.a as usize].overlaps(&world.boxes[pair.b as usize]);
    let allows = |pair: &Pair| world.filters[pair.a as usize].allows(&world.filters[pair.b as usize]);
    for &id in &found.restarted {
        let pairs = kept.partners(id).map(|other| Pair::new(id, other));
        events.removed.extend(pairs.filter(|pair| existed(pair) && !(overlaps(pair) && allows(pair))));
    }
    events.sort_and_dedup(world.ids());
}
