// Pieces: what the kernels that sort long rows share. A workgroup takes LANES windows at a time.

// A piece of a long row: the pairs of the row, and which PIECE of them.
struct Piece {
    start: u32,
    end: u32,
    index: u32,
}

fn piece_at(index: u32) -> Piece {
    let at = FIRST_PIECE + 3u * index;
    return Piece(long_rows[at], long_rows[at + 1u], long_rows[at + 2u]);
}

// Returns the number of pairs of a window of a row.
fn pairs_of_window(row: u32, window: u32) -> u32 {
    if window >= window_count() {
        return 0u;
    }
    return atomicLoad(&windows[window_at(row, window)]) & 0xffffu;
}
