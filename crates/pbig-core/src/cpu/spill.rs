//! Slots, after the sort: empty ones that boxes have left, and others behind the last, for boxes that found none empty in
//! their new cells. The boxes that such a cell has *spilled* are a list, and its entry in `starts` is marked.

use super::codes::BLOCK;
use super::record::Record;
use super::sort::Sorted;
use std::ops::Range;

/// The mark of a cell that has spilled, beside the number of its first slot.
const MARK: u32 = 1 << 31;

/// The key of an empty slot.
pub(super) const EMPTY: u32 = u32::MAX;

/// No slot: the end of a list.
const NONE: u32 = u32::MAX;

/// Slots of a cell in which an empty one is looked for: a cell may hold thousands of boxes.
const LOOK: u32 = 16;

/// Neighbours in the list of a cell.
#[derive(Clone, Copy, Debug)]
struct Link {
    next: u32,
    previous: u32,
}

/// What cells have spilled.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spill {
    /// By key: the first slot of the list, where the cell is marked.
    first: Vec<u32>,
    /// By slot, from the first behind the sorted ones on.
    links: Vec<Link>,
    /// Slots of these that are empty.
    empty: Vec<u32>,
    /// Sorted slots that are.
    left: usize,
}

impl Spill {
    /// Boxes have been sorted anew.
    pub(super) fn clear(&mut self) {
        self.links.clear();
        self.empty.clear();
        self.left = 0;
    }

    /// Spilled boxes, or slots that boxes have left, whichever are more.
    pub(super) fn out_of_order(&self) -> usize {
        (self.links.len() - self.empty.len()).max(self.left)
    }
}

impl<R: Record> Sorted<R> {
    /// The first slot of a key.
    #[inline(always)]
    pub(super) fn start(&self, key: u32) -> u32 {
        self.starts[key as usize] & !MARK
    }

    /// The slots behind those of the sort.
    pub(super) fn behind(&self) -> Range<usize> {
        self.places.len() - self.spill.links.len()..self.places.len()
    }

    /// Whether one of the cells from key `from` up to `to` may have spilled.
    #[inline(always)]
    pub(super) fn have_spilled(&self, from: u32, to: u32) -> bool {
        let cells = &self.starts[from as usize..=to as usize];
        cells.iter().fold(0, |marks, start| marks | start) & MARK != 0
    }

    /// The slots of what a cell has spilled.
    pub(super) fn spilled(&self, key: u32) -> impl Iterator<Item = u32> {
        let first = self.behind().start;
        let is_marked = self.starts[key as usize] & MARK != 0;
        let mut slot = if is_marked { self.spill.first[key as usize] } else { NONE };
        std::iter::from_fn(move || {
            let this = slot;
            slot = self.spill.links.get((this as usize).checked_sub(first)?)?.next;
            Some(this)
        })
    }

    /// A slot for one more box in a cell.
    pub(super) fn occupy(&mut self, key: u32) -> u32 {
        let start = self.start(key);
        let mut run = start..self.start(key + 1).min(start + LOOK);
        let slot = match run.find(|&slot| self.keys[slot as usize] == EMPTY) {
            Some(slot) => {
                self.spill.left -= 1;
                slot
            }
            None => self.spill_from(key),
        };
        self.keys[slot as usize] = key;
        slot
    }

    /// A slot behind the others, first in the list of its cell.
    fn spill_from(&mut self, key: u32) -> u32 {
        let slot = self.spill.empty.pop().unwrap_or_else(|| self.append());
        let head = self.spilled(key).next().unwrap_or(NONE);
        *self.link(slot) = Link { next: head, previous: NONE };
        if head != NONE {
            self.link(head).previous = slot;
        }
        self.spill.first.resize(self.starts.len().max(self.spill.first.len()), NONE);
        self.spill.first[key as usize] = slot;
        self.starts[key as usize] |= MARK;
        slot
    }

    /// One more slot, with a place.
    fn append(&mut self) -> u32 {
        let slot = self.places.len();
        self.places.push(self.records.len() as u32);
        self.records.push(R::EMPTY);
        self.keys.push(EMPTY);
        self.codes.resize(slot + 1 + BLOCK, 0);
        self.spill.links.push(Link { next: NONE, previous: NONE });
        slot as u32
    }

    fn link(&mut self, slot: u32) -> &mut Link {
        let first = self.behind().start;
        &mut self.spill.links[slot as usize - first]
    }

    /// Empties a slot.
    pub(super) fn leave(&mut self, slot: u32) {
        let key = std::mem::replace(&mut self.keys[slot as usize], EMPTY);
        self.records[self.places[slot as usize] as usize] = R::EMPTY;
        if slot as usize >= self.behind().start {
            self.unlink(slot, key);
            self.spill.empty.push(slot);
        } else {
            self.spill.left += 1;
        }
    }

    /// Takes a slot out of the list of its cell.
    fn unlink(&mut self, slot: u32, key: u32) {
        let Link { next, previous } = *self.link(slot);
        if next != NONE {
            self.link(next).previous = previous;
        }
        match (previous, next) {
            (NONE, NONE) => self.starts[key as usize] &= !MARK,
            (NONE, _) => self.spill.first[key as usize] = next,
            _ => self.link(previous).next = next,
        }
    }
}
