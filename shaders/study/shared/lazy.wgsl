// The lazy way (Avril 3.2.2): of n^2 identifiers those above the diagonal are pairs.

// Result of identifiers below the diagonal and on it.
const NO_BOX: u32 = 0xffffffffu;

// Returns the pair of an identifier, for up to 65,536 boxes.
fn lazy_pair(id: u32, n: u32) -> vec2<u32> {
    let pair = vec2<u32>(id / n, id % n);
    return select(vec2<u32>(NO_BOX), pair, pair.x < pair.y);
}
