//! The modes of a search for all pairs.

use pbig_core::{Aabb, DeviceFound, Pair, ProxyFilter, SearchRequest, oracle};
use pbig_gpu::{GpuFinder, GpuOptions};
use pbig_harness::corpus::difference;

/// A way of the device to find pairs.
#[derive(Debug)]
pub(super) struct Mode {
    pub(super) name: &'static str,
    /// Maximum number of boxes that the mode can take, or can take in seconds.
    pub(super) most_boxes: usize,
    /// The caller wants the pairs in order.
    is_sorted: bool,
    /// They come in order. Otherwise that is left to the core.
    comes_sorted: bool,
    has_grid: bool,
    /// Number of small and of large work items of a submission.
    chunk: [u32; 2],
}

const PLAIN: Mode = Mode {
    name: "plain",
    most_boxes: usize::MAX,
    is_sorted: false,
    comes_sorted: false,
    has_grid: true,
    chunk: GpuOptions::DEFAULT.chunk,
};

/// Every mode.
pub(super) const MODES: &[Mode] = &[
    PLAIN,
    Mode { name: "sorted", is_sorted: true, comes_sorted: true, ..PLAIN },
    Mode { name: "all pairs", has_grid: false, most_boxes: 1024, ..PLAIN },
    Mode { name: "chunks", chunk: [20, 3], most_boxes: 300, ..PLAIN },
    Mode { name: "sorted chunks", is_sorted: true, chunk: [20, 3], most_boxes: 300, ..PLAIN },
];

impl Mode {
    pub(super) fn options(&self) -> GpuOptions {
        let all_pairs_up_to = if self.has_grid { 0 } else { 1024 };
        GpuOptions { chunk: self.chunk, all_pairs_up_to, ..GpuOptions::DEFAULT }
    }
}

/// Compares the device's pairs with the oracle's, without and with filters. Returns their number.
pub(super) async fn check(gpu: &mut GpuFinder, mode: &Mode, boxes: &[Aabb]) -> Result<usize, String> {
    let filters = filters(boxes.len());
    let all = find(gpu, mode, boxes, None).await?;
    compare(&all, &oracle::pairs(boxes))?;
    let filtered = find(gpu, mode, boxes, Some(&filters)).await?;
    compare(&filtered, &oracle::pairs_filtered(boxes, &filters))?;
    Ok(all.len() + filtered.len())
}

/// Makes filters that put every seventh box into one body, and even and odd boxes into groups.
fn filters(n: usize) -> Vec<ProxyFilter> {
    let filter =
        |id: u32| ProxyFilter { body: id % 7, memberships: 1 + id % 2, mask: 3 - id % 3, ..ProxyFilter::ALL };
    (0..n as u32).map(filter).collect()
}

async fn find(
    gpu: &mut GpuFinder,
    mode: &Mode,
    boxes: &[Aabb],
    filters: Option<&[ProxyFilter]>,
) -> Result<Vec<Pair>, String> {
    let request = SearchRequest { boxes, filters, is_sorted: mode.is_sorted, max_pairs: u64::MAX };
    let mut found = DeviceFound::default();
    gpu.find_all_async(&request, &mut found).await.map_err(|failure| format!("{failure:?}"))?;
    if !mode.comes_sorted {
        found.pairs.sort_unstable();
    }
    Ok(found.pairs.into_vec())
}

fn compare(found: &[Pair], wanted: &[Pair]) -> Result<(), String> {
    difference(found, wanted).map_or(Ok(()), Err)
}
