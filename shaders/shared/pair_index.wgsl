// Mapping from the index of a pair to the pair, without memory access (Avril 3.2). Pairs (a, b), a < b < n, are numbered
// row by row from 0. n is at most 32,768, so that 8 k and (2 n - 1)^2 stay below 2^32.

// Estimate of the row (Avril 3.3). 0: the device's square root. 1 to 4: the inverse square root with Carmack's constant
// and so many Newton steps. 5 to 8: the same with Lomont's constant and 1 to 4 steps. 9: bisection, no square root.
override ROOT: u32 = 0u;

// Returns the index of the first pair of row a.
fn row_start(a: u32, n: u32) -> u32 {
    return a * (2u * n - a - 1u) / 2u;
}

// Returns 1 / sqrt(x): halves the exponent by integer arithmetic, then takes Newton steps y (1.5 - x y^2 / 2).
fn inverse_root(x: f32, magic: u32, steps: u32) -> f32 {
    var y = bitcast<f32>(magic - (bitcast<u32>(x) >> 1u));
    for (var i = 0u; i < steps; i++) {
        y = y * (1.5 - 0.5 * x * y * y);
    }
    return y;
}

fn root(x: f32) -> f32 {
    if ROOT == 0u {
        return sqrt(x);
    }
    if ROOT <= 4u {
        return x * inverse_root(x, 0x5f3759dfu, ROOT);
    }
    return x * inverse_root(x, 0x5f375a86u, ROOT - 4u);
}

// Returns the largest row that starts at or before k, by bisection.
fn searched_row(k: u32, n: u32) -> u32 {
    var low = 0u;
    var high = n - 1u;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if row_start(middle, n) <= k {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Returns equation 1, 0-based: (2n - 1 - sqrt((2n - 1)^2 - 8k)) / 2, rounded down. It may be off by a row or two.
fn estimated_row(k: u32, n: u32) -> u32 {
    if ROOT == 9u {
        return searched_row(k, n);
    }
    let m = 2u * n - 1u;
    let row = (f32(m) - root(f32(m * m - 8u * k))) * 0.5;
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
