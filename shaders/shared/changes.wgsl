// A search for pairs that came or went: what is known of a box is what it is, and what it was at the last
// update. The functions are those of overlaps.wgsl.

alias Subject = Motion;

// All that lies between what it was and what it is: whom it overlaps, or did, it meets in a cell. One of
// the two that is invalid does not count, as it has all of `low` above everything.
fn reach_of(one: Subject) -> Box {
    var both: Box;
    for (var k = 0u; k < 3u; k++) {
        both.low[k] = min(one.now.low[k], one.before.low[k]);
        both.high[k] = max(one.now.high[k], one.before.high[k]);
    }
    return both;
}

fn has_moved(one: Subject) -> bool {
    var moved = false;
    for (var k = 0u; k < 3u; k++) {
        moved |= one.now.low[k] != one.before.low[k] || one.now.high[k] != one.before.high[k];
    }
    return moved;
}

// Two boxes that have not moved are as they were.
fn is_due(marks: u32) -> bool {
    return (marks & MOVED) != 0u;
}

fn matter(a: Subject, b: Subject) -> bool {
    return overlap(a.now, b.now) != overlap(a.before, b.before);
}
