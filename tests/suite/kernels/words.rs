//! The contract of the words that a device returns: docs/PAIR_FORMAT.md. Words that break it are errors, never a panic.

use super::AXIS_BITS;
use pbig_core::{BoxIds, Pair, PairList};
use pbig_gpu::decode::{self, DecodeError, PLAIN};

fn plain(words: &[u32], boxes: u32, is_sorted: bool) -> Result<Vec<Pair>, DecodeError> {
    let mut pairs = PairList::default();
    decode::plain(words, BoxIds::First(boxes), is_sorted, &mut pairs).map(|()| pairs.into_vec())
}

fn records(words: &[u32], entries: &[u32], boxes: u32) -> Result<Vec<Pair>, DecodeError> {
    let mut pairs = PairList::default();
    decode::records(words, entries, BoxIds::First(boxes), &mut pairs).map(|()| pairs.into_vec())
}

fn bits(words: &[u32], boxes: u32) -> Result<Vec<Pair>, DecodeError> {
    let mut pairs = PairList::default();
    decode::bits(words, BoxIds::First(boxes), &mut pairs).map(|()| pairs.into_vec())
}

fn pair(a: u32, b: u32) -> Pair {
    Pair::new(a, b)
}

#[test]
fn the_example_of_the_format() {
    // docs/PAIR_FORMAT.md: a cell whose entries begin at 2, its first box with three others.
    let entries = [9, 9, 4, 1 | 7 << AXIS_BITS, 6, 0];
    let row = u32::from_le_bytes([0, 2, 1, 2]);
    let words = [2, 2, 0, row, 3, PLAIN | 1, 7, 8];
    let wanted = vec![pair(1, 4), pair(4, 6), pair(0, 4), pair(7, 8)];
    assert_eq!(records(&words, &entries, 10), Ok(wanted));
    assert_eq!(plain(&[1, 2, 0, 9], 10, false), Ok(vec![pair(1, 2), pair(0, 9)]));
    assert_eq!(plain(&[0, 9, 1, 2], 10, true), Ok(vec![pair(0, 9), pair(1, 2)]));
    // Pairs 0 (0, 1) and 4 (1, 3) of four boxes.
    assert_eq!(bits(&[0b01_0001], 4), Ok(vec![pair(0, 1), pair(1, 3)]));
}

#[test]
fn broken_words_are_errors() {
    let entries = [0, 1, 2];
    let what = |result: Result<Vec<Pair>, DecodeError>| result.unwrap_err().what;
    assert_eq!(what(records(&[5, 0, 0], &entries, 3)), "a record is cut off");
    assert_eq!(what(records(&[PLAIN | 0x7FFF_FFFF], &entries, 3)), "a record is cut off");
    assert_eq!(what(records(&[1, 0, 0, u32::from_le_bytes([0, 9, 1, 2])], &entries, 3)), "a row is cut off");
    assert_eq!(what(records(&[1, 2, 0, u32::from_le_bytes([0, 0, 1, 0])], &entries, 3)), "no such entry");
    assert_eq!(
        what(records(&[1, 0, 0, u32::from_le_bytes([1, 0, 1, 0])], &entries, 3)),
        "a box paired with itself"
    );
    assert_eq!(what(plain(&[1], 3, false)), "half a pair");
    assert_eq!(what(plain(&[2, 1], 3, false)), "not a < b < boxes");
    assert_eq!(what(plain(&[1, 3], 3, false)), "not a < b < boxes");
    assert_eq!(what(plain(&[0, 2, 0, 1], 3, true)), "pairs out of order");
    assert_eq!(what(plain(&[0, 1, 0, 1], 3, true)), "pairs out of order");
    assert_eq!(what(bits(&[0b1000], 3)), "a bit beyond the last pair");
    assert_eq!(what(bits(&[], 3)), "not one bit a pair");
}
