//! Decodes the words that a device returns into pairs. `docs/PAIR_FORMAT.md` defines the format.
//!
//! Words that break the format give an error, never a panic: the output of a device is untrusted input.

use crate::layout::{BOX_BITS, LANES};
use pbig_core::internal as parallel;
use pbig_core::{BoxIds, Pair, PairList};
use std::ops::Range;

/// Words that break the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the device returned words that break the pair format: {what} at word {at}")]
pub struct DecodeError {
    /// The fault.
    pub what: &'static str,
    /// Index of the word.
    pub at: usize,
}

/// Mark of a record of plain pairs.
pub const PLAIN: u32 = 1 << 31;

/// Number of words that a thread decodes at a time.
const PIECE: usize = 1 << 15;

/// Appends plain pairs: two ids each, the smaller first. Each is read once. If `is_sorted`, the list must be in order afterwards.
///
/// # Errors
/// If the number of words is odd, a pair is not `a < b < boxes`, or the order is broken. If it is the order, the pairs were appended.
pub fn plain(
    words: &[u32],
    ids: BoxIds<'_>,
    is_sorted: bool,
    pairs: &mut PairList,
) -> Result<(), DecodeError> {
    let half = DecodeError { what: "half a pair", at: words.len() };
    let given: &[Pair] = bytemuck::try_cast_slice(words).map_err(|_| half)?;
    append(given, ids, pairs)?;
    if is_sorted && !pairs.is_in_order() {
        return Err(DecodeError { what: "pairs out of order", at: words.len() });
    }
    Ok(())
}

/// Appends pairs, and checks them.
fn append(given: &[Pair], ids: BoxIds<'_>, pairs: &mut PairList) -> Result<(), DecodeError> {
    let fault = |i| DecodeError { what: "not a < b < boxes", at: 2 * i };
    pairs.append_checked(given, ids).map_err(fault)
}

/// Appends the pairs of records. They name boxes by their index in `entries`, the boxes of all cells.
///
/// # Errors
/// If a record is cut off, or names an entry or a box that does not exist. Then nothing useful was appended.
pub fn records(
    words: &[u32],
    entries: &[u32],
    ids: BoxIds<'_>,
    pairs: &mut PairList,
) -> Result<(), DecodeError> {
    let (pieces, boxes) = (pieces(words)?, ids.boxes());
    let decoded = parallel::map(pieces.len(), |i| {
        let Range { start: at, end } = pieces[i];
        // Most words have two or three pairs.
        let pairs = Vec::with_capacity(3 * (end - at));
        let mut reader = Reader { words, entries, boxes, at, pairs };
        while reader.at < end {
            reader.record()?;
        }
        Ok(reader.pairs)
    });
    decoded.into_iter().try_for_each(|piece| append(&piece?, ids, pairs))
}

/// Cuts the words between records into pieces of about [`PIECE`] words.
fn pieces(words: &[u32]) -> Result<Vec<Range<usize>>, DecodeError> {
    let (mut pieces, mut start, mut at) = (Vec::new(), 0, 0);
    while at < words.len() {
        at += record_len(words[at]);
        if at > words.len() {
            return Err(DecodeError { what: "a record is cut off", at: words.len() });
        }
        if at - start >= PIECE || at == words.len() {
            pieces.push(start..at);
            start = at;
        }
    }
    Ok(pieces)
}

/// Returns the number of words of a record, by its first word.
fn record_len(first: u32) -> usize {
    if first & PLAIN != 0 { 1 + 2 * (first & !PLAIN) as usize } else { 3 + first as usize }
}

struct Reader<'a> {
    words: &'a [u32],
    entries: &'a [u32],
    boxes: u32,
    at: usize,
    pairs: Vec<Pair>,
}

impl Reader<'_> {
    /// Reads the record at `at`. It is whole, see [`pieces`].
    fn record(&mut self) -> Result<(), DecodeError> {
        let first = self.words[self.at];
        let end = self.at + record_len(first);
        if first & PLAIN != 0 {
            for i in (self.at + 1..end).step_by(2) {
                self.pairs.push(Pair { a: self.words[i], b: self.words[i + 1] });
            }
            self.at = end;
            return Ok(());
        }
        let start = self.words[self.at + 1] as usize;
        let segments = self.words[self.at + 2];
        let base = |segment: u32| start + (segment * LANES) as usize;
        let (row_base, column_base) = (base(segments & 0xFFFF), base(segments >> 16));
        self.at += 3;
        while self.at < end {
            self.row(row_base, column_base, end)?;
        }
        Ok(())
    }

    /// Reads a row: its place in its segment, the number of partners less one, and the places of the partners, a byte
    /// each.
    fn row(&mut self, row_base: usize, column_base: usize, end: usize) -> Result<(), DecodeError> {
        let at = self.at;
        let [row, more, ..] = self.words[at].to_le_bytes();
        let partners = usize::from(more) + 1;
        // The place, the number of partners and each partner take a byte.
        self.at += (partners + 2).div_ceil(4);
        if self.at > end {
            return Err(DecodeError { what: "a row is cut off", at });
        }
        let one = self.id(row_base + usize::from(row))?;
        for i in 2..partners + 2 {
            let place = self.words[at + i / 4].to_le_bytes()[i % 4];
            let other = self.id(column_base + usize::from(place))?;
            if one == other {
                return Err(DecodeError { what: "a box paired with itself", at });
            }
            self.pairs.push(Pair::new(one, other));
        }
        Ok(())
    }

    fn id(&self, place: usize) -> Result<u32, DecodeError> {
        let id = self.entries.get(place).map(|entry| entry & ((1 << BOX_BITS) - 1));
        id.filter(|&id| id < self.boxes).ok_or(DecodeError { what: "no such entry", at: self.at })
    }
}

/// Returns the number of pairs of this number of boxes.
pub fn pair_count(boxes: u32) -> u64 {
    u64::from(boxes) * u64::from(boxes.saturating_sub(1)) / 2
}

/// Appends, in order, the pairs of one bit for each pair of `boxes` boxes, in Avril's numbering: (0, 1), (0, 2), .., (1, 2), ..
///
/// # Errors
/// If the number of words is not that of the pairs' bits, or if a bit beyond the last pair is set.
pub fn bits(words: &[u32], ids: BoxIds<'_>, pairs: &mut PairList) -> Result<(), DecodeError> {
    let (boxes, all) = (ids.boxes(), pair_count(ids.boxes()));
    if words.len() as u64 != all.div_ceil(32) {
        return Err(DecodeError { what: "not one bit a pair", at: words.len() });
    }
    // The row of pairs (a, b) of the last bit, and the numbers of the row's pairs.
    let (mut a, mut row) = (0, 0..u64::from(boxes).saturating_sub(1));
    let mut found = Vec::new();
    for (at, &word) in words.iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            let k = 32 * at as u64 + u64::from(rest.trailing_zeros());
            rest &= rest - 1;
            if k >= all {
                return Err(DecodeError { what: "a bit beyond the last pair", at });
            }
            while k >= row.end {
                a += 1;
                row = row.end..row.end + u64::from(boxes - 1 - a);
            }
            found.push(Pair { a, b: a + 1 + (k - row.start) as u32 });
        }
    }
    append(&found, ids, pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns more pairs than two threads take at a time, in order.
    fn many() -> Vec<Pair> {
        (3..5 * PIECE as u32).map(|i| Pair { a: i / 3, b: i / 3 + 1 + i % 3 }).collect()
    }

    /// Output that came in two parts is one list.
    #[test]
    fn pairs_out_of_order_at_the_seam_of_two_parts_are_found() {
        let (parts, seam) = (many(), 2 * PIECE + 1);
        let in_parts = |second: &[Pair]| {
            let mut all = PairList::default();
            [&parts[..seam], second]
                .into_iter()
                .try_for_each(|part| {
                    plain(bytemuck::cast_slice(part), BoxIds::First(1 << 30), true, &mut all)
                })
                .map(|()| all.into_vec())
        };
        assert_eq!(in_parts(&parts[seam..]).as_ref(), Ok(&parts));
        for second in [&parts[seam - 1..], &parts[..1]] {
            assert_eq!(in_parts(second).map_err(|fault| fault.what), Err("pairs out of order"));
        }
    }

    /// One record after the other, each a row of three partners.
    #[test]
    fn records_of_several_pieces_are_appended_in_their_order() {
        let entries: Vec<u32> = (0..4).collect();
        let record = [2, 0, 0, u32::from_le_bytes([0, 2, 1, 2]), u32::from_le_bytes([3, 0, 0, 0])];
        let repeats = 20_000;
        let row = [Pair { a: 0, b: 1 }, Pair { a: 0, b: 2 }, Pair { a: 0, b: 3 }];
        let (mut pairs, ids) = (PairList::from(vec![row[0]]), BoxIds::First(4));
        assert_eq!(records(&record.repeat(repeats), &entries, ids, &mut pairs), Ok(()));
        assert_eq!(*pairs, [&row[..1], &row.repeat(repeats)].concat());
        let mut words = record.repeat(repeats);
        *words.last_mut().expect("there are words") = 9;
        let fault =
            records(&words, &entries, ids, &mut PairList::default()).expect_err("there is no entry 9");
        assert_eq!((fault.what, fault.at), ("no such entry", words.len()));
    }
}
