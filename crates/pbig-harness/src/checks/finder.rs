//! The pairs of a finder are the oracle's, bit by bit, also in its second call and with filters.

use super::input::Input;
use pbig_core::{Aabb, Backend, Config, Engine, Finder, Order, ProxyFilter, oracle};

/// One byte of settings, then boxes, each with a filter if the settings ask for filters.
pub fn finder_against_oracle(data: &[u8]) {
    let mut input = Input(data);
    let Some(settings) = input.byte() else { return };
    let config = config(settings);
    let mut finder = Finder::new(config);
    let filtered = settings & 16 != 0;
    let (boxes, filters) = read(&mut input, filtered);
    // Half of the boxes a second time: nothing of the first call may be left.
    for n in [boxes.len(), boxes.len() / 2] {
        check_finder(&mut finder, config.order, &boxes[..n], filtered.then_some(&filters[..n]));
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

/// Returns the settings of the finder. A forced engine takes a grid even for few boxes.
pub(super) fn config(settings: u8) -> Config {
    let base = Config { backend: Backend::Cpu, ..Config::DEFAULT };
    let grid = Config { engine: Some(Engine::Grid), ..base };
    match settings & 3 {
        0 => base,
        1 => grid,
        2 => Config { order: Order::Unspecified, engine: Some(Engine::Tree), ..base },
        _ => Config { backend: Backend::Brute, ..base },
    }
}

fn check_finder(finder: &mut Finder, order: Order, boxes: &[Aabb], filters: Option<&[ProxyFilter]>) {
    let found = match filters {
        Some(filters) => finder.find_filtered(boxes, filters),
        None => finder.find(boxes),
    };
    let mut found = found.expect("few boxes").to_vec();
    if order == Order::Unspecified {
        found.sort_unstable();
    }
    let wanted =
        filters.map_or_else(|| oracle::pairs(boxes), |filters| oracle::pairs_filtered(boxes, filters));
    assert_eq!(found, wanted, "{}", finder.report().plan);
}
