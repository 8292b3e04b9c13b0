// Cells at a level, computed from those at the finest resolution, in integers only (contract 3).

// Offset that makes every cell positive. All cells have the same, so distances do not change.
const OFFSET = 0x40000000;

// Cells of a box at a level: the lowest on each axis, wrapped around, and their number on each axis.
struct Touched {
    wrapped: vec3<u32>,
    span: vec3<u32>,
}

fn touched(low: vec3<i32>, high: vec3<i32>, level: u32) -> Touched {
    let dims = params.level[level].dims;
    let shift = params.level[level].shift;
    let divided = dims > vec3<u32>(1u);
    let first = low >> vec3<u32>(shift);
    let span = vec3<u32>((high >> vec3<u32>(shift)) - first) + 1u;
    let wrapped = vec3<u32>(first + OFFSET) % dims;
    return Touched(select(vec3<u32>(0u), wrapped, divided), select(vec3<u32>(1u), span, divided));
}

fn cell_count(t: Touched) -> u32 {
    return t.span.x * t.span.y * t.span.z;
}

// Returns the index of the `k`-th cell, and the bits of an entry that mark the axes on which this cell is the lowest.
fn cell_at(t: Touched, k: u32, level: u32) -> vec2<u32> {
    let step = vec3<u32>(k % t.span.x, k / t.span.x % t.span.y, k / (t.span.x * t.span.y));
    let dims = params.level[level].dims;
    var at = t.wrapped + step;
    at = select(at, at - dims, at >= dims);
    let index = params.level[level].first_cell + (at.z * dims.y + at.y) * dims.x + at.x;
    let lowest = select(vec3<u32>(0u), vec3<u32>(1u, 2u, 4u), step == vec3<u32>(0u));
    return vec2<u32>(index, (lowest.x | lowest.y | lowest.z) << AXIS_BITS);
}

// Returns the level of a located box, without the mark.
fn own_level(at: Located) -> u32 {
    return at.level & (MOVED - 1u);
}

fn low_of(at: Located) -> vec3<i32> {
    return vec3<i32>(at.low[0], at.low[1], at.low[2]);
}

fn high_of(at: Located) -> vec3<i32> {
    return vec3<i32>(at.high[0], at.high[1], at.high[2]);
}
