// Mapping from the index of a pair to the pair, without memory access (Avril 3.2). Pairs (a, b), a < b < n, are numbered
// row by row from 0. n is at most 32,768, so that 8 k and (2 n - 1)^2 stay below 2^32.

// Returns the index of the first pair of row a.
fn row_start(a: u32, n: u32) -> u32 {
    return a * (2u * n - a - 1u) / 2u;
}

// Returns equation 1, 0-based: (2n - 1 - sqrt((2n - 1)^2 - 8k)) / 2, rounded down. It may be off by a row or two.
fn estimated_row(k: u32, n: u32) -> u32 {
    let m = 2u * n - 1u;
    let row = (f32(m) - sqrt(f32(m * m - 8u * k))) * 0.5;
    return min(u32(max(row, 0.0)), n - 2u);
}

// Returns the exact pair: integers correct the row, however the root was rounded.
fn pair_at(k: u32, n: u32) -> vec2<u32> {
    var a = estimated_row(k, n);
    while row_start(a, n) > k {
        a -= 1u;
    }
    while a + 2u < n && row_start(a + 1u, n) <= k {
        a += 1u;
    }
    return vec2<u32>(a, a + 1u + k - row_start(a, n));
}
