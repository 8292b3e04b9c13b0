// The lists that are scanned: those of the cells, or if ROWS is set the rows of pairs.

override ROWS: bool = false;

// Returns the number of lists: residents and visitors of each cell, or a row for each box.
fn scanned() -> u32 {
    return select(2u * params.cells, params.boxes, ROWS);
}
