// Rows: the pairs of each first box, one row after the other.

// Maximum number of pairs of a row whose places are found by counting; longer rows are sorted window by window.
const SHORT_ROW = 512u;
// Second boxes of a window: a workgroup sorts them through a bitmap.
const WINDOW = 32768u;
// Pairs of a long row for a workgroup.
const PIECE = 4096u;

// Words of `long_rows`: the size of an indirect dispatch, the number of pieces, and three words for each piece.
const PIECES = 3u;
const FIRST_PIECE = 4u;

fn window_count() -> u32 {
    return (params.boxes + WINDOW - 1u) / WINDOW;
}

// Returns the index of the counter of a window of the long row that begins at `start`. Starts of long rows differ by more than
// SHORT_ROW. The lower half of a counter is the number of pairs, the upper half that of placed ones: both at most WINDOW.
fn window_at(start: u32, window: u32) -> u32 {
    return start / SHORT_ROW * window_count() + window;
}
