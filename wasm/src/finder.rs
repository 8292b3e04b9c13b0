//! `Finder` against the oracle.

use crate::Fault;
use pbig_core::{Aabb, Backend, Config, Error, Finder, Pair, ProxyFilter, oracle};
use pbig_harness::boxes::moved;
use pbig_harness::corpus::difference;

/// Compares the pairs of a set of boxes with the oracle's: as they are, moved, and with filters.
pub(crate) fn check(boxes: &[Aabb], backend: Backend, fault: Fault) -> Result<(), String> {
    // One finder for all three, so that the later calls meet the buffers of the earlier ones.
    let mut finder = Finder::new(Config { backend, ..Config::DEFAULT });
    compare("found", finder.find(boxes), &oracle::pairs(boxes), fault)?;
    let later = moved(boxes, 0.5, 1);
    compare("found again", finder.find(&later), &oracle::pairs(&later), fault)?;
    let filters = filters(boxes.len());
    let wanted = oracle::pairs_filtered(boxes, &filters);
    compare("found with filters", finder.find_filtered(boxes, &filters), &wanted, fault)
}

/// Makes filters that put every seventh box into one body, and even and odd boxes into groups.
fn filters(n: usize) -> Vec<ProxyFilter> {
    let filter =
        |id: u32| ProxyFilter { body: id % 7, memberships: 1 + id % 2, mask: 3 - id % 3, ..ProxyFilter::ALL };
    (0..n as u32).map(filter).collect()
}

fn compare(what: &str, found: Result<&[Pair], Error>, wanted: &[Pair], fault: Fault) -> Result<(), String> {
    let mut found = found.map_err(|error| format!("{what}: {error}"))?.to_vec();
    fault.lose(Fault::FinderLoses, &mut found);
    fault.repeat(Fault::FinderRepeats, &mut found);
    difference(&found, wanted).map_or(Ok(()), |why| Err(format!("{what}: {why}")))
}
