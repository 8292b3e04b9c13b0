// Cells at a level, computed from those at the finest resolution, in integers only (contract 3).

// Cells of a box at a level: the lowest on each axis, wrapped around, and their number on each axis.
struct Touched {
    wrapped: vec3<u32>,
    span: vec3<u32>,
}

fn touched(at: Located, level: u32) -> Touched {
    let dims = params.level[level].dims;
    let shift = params.level[level].shift - params.level[own_level(at)].shift;
    let divided = dims > vec3<u32>(1u);
    let low = vec3<i32>(at.low[0], at.low[1], at.low[2]);
    let steps = (vec3<u32>(at.shape) >> vec3<u32>(SPAN_BITS, SPAN_BITS + 2u, SPAN_BITS + 4u)) & vec3<u32>(3u);
    let first = low >> vec3<u32>(shift);
    let span = vec3<u32>(((low + vec3<i32>(steps)) >> vec3<u32>(shift)) - first) + 1u;
    let wrapped = vec3<u32>(first) % dims;
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

// Returns the level of a located box, or for an invalid one a number beyond all levels.
fn own_level(at: Located) -> u32 {
    return at.shape & ((1u << SPAN_BITS) - 1u);
}

// Returns the cells of a box at its level, from those at the finest resolution. An axis that is not divided there is not divided
// in coarser levels, so its number of cells may be any.
fn located_at(low: vec3<i32>, high: vec3<i32>, level: u32) -> Located {
    let shift = vec3<u32>(params.level[level].shift);
    let first = low >> shift;
    let steps = min(vec3<u32>((high >> shift) - first), vec3<u32>(3u));
    let spans = steps.x | (steps.y << 2u) | (steps.z << 4u);
    return Located(array<i32, 3>(first.x, first.y, first.z), level | (spans << SPAN_BITS));
}
