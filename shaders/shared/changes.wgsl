// A search for pairs that came or went: what is known of a box is what it is, and what it was at the last
// update. The functions are those of overlaps.wgsl.

alias Subject = Motion;

fn low_corner(one: Box) -> vec3<i32> {
    return vec3<i32>(one.low[0], one.low[1], one.low[2]);
}

fn high_corner(one: Box) -> vec3<i32> {
    return vec3<i32>(one.high[0], one.high[1], one.high[2]);
}

// All that lies between what it was and what it is: whom it overlaps, or did, it meets in a cell. One of
// the two that is invalid does not count, as it has all of `low` above everything.
fn reach_of(one: Subject) -> Box {
    let low = min(low_corner(one.now), low_corner(one.before));
    let high = max(high_corner(one.now), high_corner(one.before));
    return Box(array<i32, 3>(low.x, low.y, low.z), array<i32, 3>(high.x, high.y, high.z));
}

fn has_moved(one: Subject) -> bool {
    return any(low_corner(one.now) != low_corner(one.before))
        || any(high_corner(one.now) != high_corner(one.before));
}

// Two boxes that have not moved are as they were.
fn is_due(marks: u32) -> bool {
    return (marks & MOVED) != 0u;
}

fn matter(a: Subject, b: Subject) -> bool {
    return overlap(a.now, b.now) != overlap(a.before, b.before);
}
