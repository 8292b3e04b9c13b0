// Ends of lists that lie one after the other, as the scan leaves them in the place of the lists' lengths: within its block
// an inclusive prefix sum, and for each block the sum of those before. A scatter fills each list from its end and leaves
// its start there.

// Returns the sum of the blocks before that of a list.
fn block_start(list: u32) -> u32 {
    return sums[list / COUNTS_PER_BLOCK];
}
