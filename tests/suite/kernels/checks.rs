//! The twins of the kernels that check pairs.

use super::*;

/// The result of a check.
#[derive(Default)]
pub(super) struct TestedPairs {
    pub(super) made: u64,
    pub(super) redundant: u64,
    pub(super) overlaps: u64,
    pub(super) pairs: Vec<Pair>,
}

impl TestedPairs {
    /// Tests two entries of a cell.
    pub(super) fn test_entries(&mut self, s: &State, a: u32, b: u32) {
        let (i, j) = (box_of(a), box_of(b));
        if !may_own(a | b) {
            self.made += 1;
            self.redundant += 1;
        } else {
            self.test_boxes(s, i, j);
        }
    }

    pub(super) fn test_boxes(&mut self, s: &State, i: u32, j: u32) {
        self.made += 1;
        let [one, other] = [i, j].map(|id| DeviceBox::new(&s.boxes[id as usize]));
        if !overlap(&one, &other) {
            return;
        }
        self.overlaps += 1;
        if !s.has(FILTERED) || s.filters[i as usize].allows(&s.filters[j as usize]) {
            self.pairs.push(Pair::new(i, j));
        }
    }

    /// Writes the result into the state, unless the limit of pairs was passed before.
    pub(super) fn leave(self, s: &mut State) {
        if wide(s.totals.words) / 2 > wide(s.chunk.pairs_left) {
            return;
        }
        s.out = self.pairs.iter().flat_map(|pair| [pair.a, pair.b]).collect();
        let add = |total: &mut [u32; 2], more: u64| *total = halves(wide(*total) + more);
        add(&mut s.totals.words, s.out.len() as u64);
        add(&mut s.totals.made, self.made);
        add(&mut s.totals.redundant, self.redundant);
        add(&mut s.totals.overlaps, self.overlaps);
    }
}

pub(super) fn box_of(entry: u32) -> u32 {
    entry & ((1 << BOX_BITS) - 1)
}

/// Returns true if a cell may own a pair of entries with these marks.
fn may_own(marks: u32) -> bool {
    marks >> AXIS_BITS == 7
}

fn overlap(a: &DeviceBox, b: &DeviceBox) -> bool {
    (0..3).all(|k| a.low[k] <= b.high[k] && b.low[k] <= a.high[k])
}

/// Returns the items of a chunk.
pub(super) fn taken<T>(items: &[T], first: u32, count: u32) -> &[T] {
    let first = (first as usize).min(items.len());
    &items[first..(first + count as usize).min(items.len())]
}

pub(super) fn check_small(s: &mut State) {
    let mut checked = TestedPairs::default();
    for item in taken(&s.small_items, s.chunk.first_small, s.chunk.small_items) {
        let slots = taken(&s.slots, item.slot, item.slots);
        for pair in item.first_pair..item.first_pair + item.pairs {
            let slot = slots.iter().rfind(|slot| slot.first_pair <= pair).expect("a slot has the pair");
            let (i, j) = pair_of((pair - slot.first_pair).into(), (slot.shape & 0xFFFF).into());
            let entry = |place: u64| s.entries[slot.start as usize + place as usize];
            checked.test_entries(s, entry(i), entry(j));
        }
    }
    checked.leave(s);
}

pub(super) fn check_large(s: &mut State) {
    let mut checked = TestedPairs::default();
    for item in taken(&s.large_items, s.chunk.first_large, s.chunk.large_items) {
        check_large_item(s, item, &mut checked);
    }
    checked.leave(s);
}

pub(super) fn check_large_item(s: &State, item: &LargeItem, checked: &mut TestedPairs) {
    let entry = |place: u32| s.entries[(item.start + place) as usize];
    let segments = |from: u32, to: u32| from * LANES..(to * LANES).min(item.boxes);
    let (rows, columns) = (segments(item.row, item.row + 1), segments(item.column, item.end_column));
    // If the cell is the lowest of no box on some axis, it owns none of these pairs and tests none.
    let marks = rows.clone().chain(columns.clone()).fold(0, |marks, place| marks | entry(place));
    if !may_own(marks) {
        return;
    }
    for i in rows.start..rows.end.min(item.residents) {
        for j in columns.start.max(i + 1)..columns.end {
            checked.test_entries(s, entry(i), entry(j));
        }
    }
}

pub(super) fn check_all(s: &mut State) {
    let mut checked = TestedPairs::default();
    for a in 0..s.params.boxes {
        for b in a + 1..s.params.boxes {
            checked.test_boxes(s, a, b);
        }
    }
    checked.leave(s);
}
