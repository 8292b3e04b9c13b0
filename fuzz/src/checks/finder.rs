//! A finder's pairs are the oracle's, bit by bit, also in its second call and with filters.

use super::input::{Input, config};
use pbig_core::{Aabb, Finder, Pair, ProxyFilter, oracle};

/// One byte of settings, then boxes, each with a filter where the settings say so.
pub fn finder_against_oracle(data: &[u8]) {
    let mut input = Input(data);
    let Some(settings) = input.byte() else { return };
    let mut finder = Finder::new(config(settings & 15));
    let filtered = settings & 16 != 0;
    let (boxes, filters) = read(&mut input, filtered);
    // Half of them a second time: nothing of the first call may be left.
    for n in [boxes.len(), boxes.len() / 2] {
        let (boxes, filters) = (&boxes[..n], &filters[..n]);
        let open = vec![ProxyFilter::ALL; n];
        let wanted = oracle::pairs_filtered(boxes, if filtered { filters } else { &open });
        let found = if filtered { finder.find_filtered(boxes, filters) } else { finder.find(boxes) };
        let found = found.map(<[Pair]>::to_vec);
        assert_eq!(found, Ok(wanted), "{}", finder.report().plan);
    }
}

fn read(input: &mut Input, filtered: bool) -> (Vec<Aabb>, Vec<ProxyFilter>) {
    let (mut boxes, mut filters) = (Vec::new(), Vec::new());
    while let Some(aabb) = input.aabb(&boxes) {
        boxes.push(aabb);
        filters.push(if filtered { input.filter().unwrap_or_default() } else { ProxyFilter::ALL });
    }
    (boxes, filters)
}
