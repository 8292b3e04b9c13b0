//! Decodes the words that a device returns into pairs. `docs/PAIR_FORMAT.md` defines the format.
//!
//! Words that break the format give an error, never a panic: the output of a device is untrusted input.

use crate::Pair;
use crate::layout::{BOX_BITS, LANES};
use rayon::prelude::*;

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

/// Decodes plain pairs: two ids each, the smaller first.
///
/// # Errors
/// If the number of words is odd, or a pair is not `a < b < boxes`.
pub fn plain(words: &[u32], boxes: u32) -> Result<Vec<Vec<Pair>>, DecodeError> {
    if !words.len().is_multiple_of(2) {
        return Err(DecodeError { what: "half a pair", at: words.len() });
    }
    let pieces = words.par_chunks(PIECE).enumerate();
    pieces.map(|(i, piece)| plain_piece(piece, boxes, i * PIECE)).collect()
}

fn plain_piece(words: &[u32], boxes: u32, at: usize) -> Result<Vec<Pair>, DecodeError> {
    let pair = |(i, two): (usize, &[u32])| {
        let (a, b) = (two[0], two[1]);
        let wrong = DecodeError { what: "not a < b < boxes", at: at + 2 * i };
        if a < b && b < boxes { Ok(Pair { a, b }) } else { Err(wrong) }
    };
    words.chunks_exact(2).enumerate().map(pair).collect()
}

/// Decodes records. They name boxes by their index in `entries`, the boxes of all cells.
///
/// # Errors
/// If a record is cut off, or names an entry or a box that does not exist.
pub fn records(words: &[u32], entries: &[u32], boxes: u32) -> Result<Vec<Vec<Pair>>, DecodeError> {
    let pieces = pieces(words)?;
    pieces
        .into_par_iter()
        .map(|range| {
            let mut reader = Reader { words, entries, boxes, at: range.start, pairs: Vec::new() };
            while reader.at < range.end {
                reader.record()?;
            }
            Ok(reader.pairs)
        })
        .collect()
}

/// Cuts the words between records into pieces of about [`PIECE`] words.
fn pieces(words: &[u32]) -> Result<Vec<std::ops::Range<usize>>, DecodeError> {
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
            self.pairs.extend(plain_piece(&self.words[self.at + 1..end], self.boxes, self.at + 1)?);
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

/// Returns the number of pairs of so many boxes.
pub(crate) fn pair_count(boxes: u32) -> u64 {
    u64::from(boxes) * u64::from(boxes.saturating_sub(1)) / 2
}

/// Decodes one bit for each pair of `boxes` boxes, in Avril's numbering: (0, 1), (0, 2), .., (1, 2), ..
///
/// # Errors
/// If the number of words is not that of the pairs' bits, or if a bit beyond the last pair is set.
pub fn bits(words: &[u32], boxes: u32) -> Result<Vec<Vec<Pair>>, DecodeError> {
    let all = pair_count(boxes);
    if words.len() as u64 != all.div_ceil(32) {
        return Err(DecodeError { what: "not one bit a pair", at: words.len() });
    }
    let mut pairs = Vec::new();
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
    Ok(vec![pairs])
}
