// Rows: the pairs of each first box, one row after the other.

// Maximum number of pairs of a row whose places are found by counting; longer rows are sorted through a bitmap.
const SHORT_ROW = 512u;
// Second boxes of a long row that a workgroup sorts.
const WINDOW = 32768u;

// Returns a second box without the mark.
fn second_of(word: u32) -> u32 {
    return word & ~ENDED;
}
