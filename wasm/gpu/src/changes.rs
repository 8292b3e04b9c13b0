//! A search for changes: two updates of the same boxes, against the difference of the oracle's lists.

use crate::modes::{compare, filters};
use pbig_core::PairDevice;
use pbig_core::{Aabb, ChangeRequest, ChangedBox, DeviceFound, Pair, ProxyFilter, oracle};
use pbig_gpu::GpuFinder;
use pbig_harness::boxes::moved;

/// Compares the changes of an update in which all boxes are new, and of one in which every third moves. Returns their number.
pub(crate) async fn check(gpu: &mut GpuFinder, boxes: &[Aabb]) -> Result<usize, String> {
    let filters = filters(boxes.len());
    let shifted = moved(boxes, 0.5, 3);
    let later: Vec<Aabb> = boxes
        .iter()
        .zip(shifted)
        .enumerate()
        .map(|(i, (&now, later))| if i % 3 == 0 { later } else { now })
        .collect();
    gpu.forget();
    let first = update(gpu, &vec![Aabb::NOWHERE; boxes.len()], boxes, &filters, |_| true).await?;
    let second = update(gpu, boxes, &later, &filters, |i| i % 3 == 0).await?;
    Ok(first + second)
}

async fn update(
    gpu: &mut GpuFinder,
    before: &[Aabb],
    now: &[Aabb],
    filters: &[ProxyFilter],
    is_changed: impl Fn(usize) -> bool,
) -> Result<usize, String> {
    let changed: Vec<_> = (0..now.len())
        .filter(|&i| is_changed(i))
        .map(|i| ChangedBox { id: i as u32, aabb: before[i], filter: filters[i] })
        .collect();
    let [old, new] = [before, now].map(|boxes| oracle::pairs_filtered(boxes, filters));
    let request = ChangeRequest {
        boxes: now,
        filters,
        changed: &changed,
        kept: old.len() as u64,
        max_pairs: u64::MAX / 2,
    };
    let mut found = DeviceFound::default();
    gpu.find_changed_async(&request, &mut found).await.map_err(|failure| format!("{failure:?}"))?;
    compare_changes(found, &old, &new)
}

/// Compares the changes with those of two lists. A restarted box counts as absent before.
fn compare_changes(mut found: DeviceFound, old: &[Pair], new: &[Pair]) -> Result<usize, String> {
    let restarted = |pair: &Pair| [pair.a, pair.b].iter().any(|id| found.restarted.binary_search(id).is_ok());
    let lacks = |list: &[Pair], pair: &Pair| list.binary_search(pair).is_err();
    let added: Vec<_> = new.iter().filter(|pair| lacks(old, pair) || restarted(pair)).copied().collect();
    let ended: Vec<_> = old.iter().filter(|pair| lacks(new, pair) && !restarted(pair)).copied().collect();
    found.pairs.sort_unstable();
    found.ended.sort_unstable();
    compare(&found.pairs, &added).map_err(|why| format!("added, {why}"))?;
    compare(&found.ended, &ended).map_err(|why| format!("ended, {why}"))?;
    Ok(added.len() + ended.len())
}
