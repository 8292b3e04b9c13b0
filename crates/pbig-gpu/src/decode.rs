//! Decodes the words that a device returns into pairs. `docs/PAIR_FORMAT.md` defines the format.
//!
//! Words that break the format give an error, never a panic: the output of a device is untrusted input.

use crate::layout::{BOX_BITS, LANES};
use pbig_core::Pair;
use pbig_core::internal::{self as parallel, SharedSlice};
use std::mem::MaybeUninit;
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

/// Appends plain pairs: two ids each, the smaller first. If `is_sorted`, they must be in order, also after those in the list.
///
/// # Errors
/// If the number of words is odd, a pair is not `a < b < boxes`, or the order is broken. Then some pairs were appended.
pub fn plain(words: &[u32], boxes: u32, is_sorted: bool, pairs: &mut Vec<Pair>) -> Result<(), DecodeError> {
    let given = whole_pairs(words)?;
    let (start, last) = (pairs.len(), pairs.last().copied());
    let pieces: Vec<&[Pair]> = given.chunks(2 * PIECE).collect();
    pairs.reserve(given.len());
    let places = SharedSlice::new(&mut pairs.spare_capacity_mut()[..given.len()]);
    let are_good = parallel::map(pieces.len(), |i| {
        let (at, piece) = (2 * PIECE * i, pieces[i]);
        // SAFETY: the place is inside the reserved memory, and no other piece has it.
        let copied = copy_into(unsafe { places.part(at..at + piece.len()) }, piece);
        let before = i.checked_sub(1).map_or(last.as_ref(), |i| pieces[i].last());
        let is_in_order = || copied.is_sorted_by(|a, b| a < b) && before < copied.first();
        // Without an early end, so that the compiler uses SIMD.
        let are_pairs = copied.iter().fold(true, |all, pair| all & (pair.a < pair.b) & (pair.b < boxes));
        are_pairs && (!is_sorted || is_in_order())
    });
    // SAFETY: as many pairs were reserved, and written.
    unsafe { pairs.set_len(start + given.len()) };
    let faulty = are_good.iter().position(|is_good| !is_good);
    faulty.map_or(Ok(()), |i| Err(fault_of(pieces[i], boxes, 4 * PIECE * i)))
}

/// Copies pairs, and returns the copy. This is read from then on: the words may lie in memory of a device, which is slow.
fn copy_into<'a>(place: &'a mut [MaybeUninit<Pair>], pairs: &[Pair]) -> &'a [Pair] {
    for (place, pair) in place.iter_mut().zip(pairs) {
        place.write(*pair);
    }
    // SAFETY: a pair was written into each place: both are equally long.
    unsafe { std::slice::from_raw_parts(place.as_ptr().cast(), place.len()) }
}

/// Returns the error of a piece whose first word is `at`.
fn fault_of(piece: &[Pair], boxes: u32, at: usize) -> DecodeError {
    let fault = (at..).step_by(2).zip(piece).find_map(|(at, pair)| checked(*pair, boxes, at).err());
    fault.unwrap_or(DecodeError { what: "pairs out of order", at })
}

/// Returns the pair at a word, or an error if it is none.
fn checked(pair: Pair, boxes: u32, at: usize) -> Result<Pair, DecodeError> {
    let is_pair = pair.a < pair.b && pair.b < boxes;
    is_pair.then_some(pair).ok_or(DecodeError { what: "not a < b < boxes", at })
}

fn whole_pairs(words: &[u32]) -> Result<&[Pair], DecodeError> {
    let half = DecodeError { what: "half a pair", at: words.len() };
    bytemuck::try_cast_slice(words).map_err(|_| half)
}

/// Appends the pairs of records. They name boxes by their index in `entries`, the boxes of all cells.
///
/// # Errors
/// If a record is cut off, or names an entry or a box that does not exist. Then nothing useful was appended.
pub fn records(words: &[u32], entries: &[u32], boxes: u32, pairs: &mut Vec<Pair>) -> Result<(), DecodeError> {
    let pieces = pieces(words)?;
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
    for piece in decoded {
        pairs.append(&mut piece?);
    }
    Ok(())
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
                let pair = Pair { a: self.words[i], b: self.words[i + 1] };
                self.pairs.push(checked(pair, self.boxes, i)?);
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
pub fn bits(words: &[u32], boxes: u32, pairs: &mut Vec<Pair>) -> Result<(), DecodeError> {
    let all = pair_count(boxes);
    if words.len() as u64 != all.div_ceil(32) {
        return Err(DecodeError { what: "not one bit a pair", at: words.len() });
    }
    // The row of pairs (a, b) of the last bit, and the numbers of the row's pairs.
    let (mut a, mut row) = (0, 0..u64::from(boxes).saturating_sub(1));
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
            pairs.push(Pair { a, b: a + 1 + (k - row.start) as u32 });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pair that is there before.
    const FIRST: Pair = Pair { a: 0, b: 8 };

    /// More pairs than two threads take at a time, in order, after [`FIRST`].
    fn many() -> Vec<Pair> {
        (3..5 * PIECE as u32).map(|i| Pair { a: i / 3, b: i / 3 + 1 + i % 3 }).collect()
    }

    fn words_of(pairs: &[Pair]) -> Vec<u32> {
        bytemuck::cast_slice(pairs).to_vec()
    }

    fn decoded(pairs: &[Pair]) -> Result<Vec<Pair>, DecodeError> {
        let mut all = vec![FIRST];
        plain(&words_of(pairs), u32::MAX, true, &mut all)?;
        Ok(all.split_off(1))
    }

    #[test]
    fn pairs_of_several_pieces_are_appended_in_their_order() {
        assert_eq!(decoded(&many()), Ok(many()));
    }

    #[test]
    fn a_fault_in_any_piece_or_between_two_is_found_and_named() {
        let piece = 2 * PIECE;
        for at in [0, 1, piece - 1, piece, 2 * piece, many().len() - 1] {
            let mut pairs = many();
            pairs[at].a = pairs[at].b;
            let wanted = DecodeError { what: "not a < b < boxes", at: 2 * at };
            assert_eq!(decoded(&pairs), Err(wanted), "at {at}");
        }
        for at in [0, piece - 2, piece - 1, piece, 2 * piece - 1] {
            let mut pairs = many();
            pairs.swap(at, at + 1);
            assert_eq!(decoded(&pairs).expect_err("two are swapped").what, "pairs out of order", "at {at}");
        }
    }

    /// Output that came in two parts is one list.
    #[test]
    fn pairs_out_of_order_at_the_seam_of_two_parts_are_found() {
        let (parts, seam) = (many(), 2 * PIECE + 1);
        let in_parts = |second: &[Pair]| {
            let mut all = vec![];
            plain(&words_of(&parts[..seam]), u32::MAX, true, &mut all)?;
            plain(&words_of(second), u32::MAX, true, &mut all).map(|()| all)
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
        let mut pairs = vec![row[0]];
        assert_eq!(records(&record.repeat(repeats), &entries, 4, &mut pairs), Ok(()));
        assert_eq!(pairs, [&row[..1], &row.repeat(repeats)].concat());
        let mut words = record.repeat(repeats);
        *words.last_mut().expect("there are words") = 9;
        let fault = records(&words, &entries, 4, &mut Vec::new()).expect_err("there is no entry 9");
        assert_eq!((fault.what, fault.at), ("no such entry", words.len()));
    }
}
