// Search for changes. A wanted pair overlaps now and did not at the last update, or the other way round. The functions
// replace those of search_overlaps.wgsl.

alias KnownBox = Motion;

// Number of boxes of small cells that fit workgroup memory.
const STAGED = 192u;

// Returns true if a stored box is not yet as the checks need it: an earlier update has changed it, this one has not.
fn is_stale(one: KnownBox, has_changed: bool) -> bool {
    return !has_changed && has_moved(one);
}

// Returns a box as the checks need it.
fn renewed(one: KnownBox, has_changed: bool) -> KnownBox {
    if is_stale(one, has_changed) {
        return Motion(one.now, one.now);
    }
    return one;
}

fn checked_box(one: KnownBox) -> KnownBox {
    return one;
}

fn low_corner(one: DeviceBox) -> vec3<i32> {
    return vec3<i32>(one.low[0], one.low[1], one.low[2]);
}

fn high_corner(one: DeviceBox) -> vec3<i32> {
    return vec3<i32>(one.high[0], one.high[1], one.high[2]);
}

// Returns the box around the box now and at the last update: in its cells it meets every box that it overlaps or
// overlapped. An invalid box adds nothing, because all of its `low` lies above everything.
fn bounds_of(one: KnownBox) -> DeviceBox {
    let low = min(low_corner(one.now), low_corner(one.before));
    let high = max(high_corner(one.now), high_corner(one.before));
    return DeviceBox(array<i32, 3>(low.x, low.y, low.z), array<i32, 3>(high.x, high.y, high.z));
}

fn has_moved(one: KnownBox) -> bool {
    return any(low_corner(one.now) != low_corner(one.before))
        || any(high_corner(one.now) != high_corner(one.before));
}

// Two boxes that have not moved cannot be wanted.
fn may_be_wanted(marks: u32) -> bool {
    return (marks & MOVED) != 0u;
}

fn is_wanted(a: KnownBox, b: KnownBox) -> bool {
    return overlap(a.now, b.now) != overlap(a.before, b.before);
}

// Returns the mark of a wanted pair in the output.
fn mark_of(a: KnownBox, b: KnownBox) -> u32 {
    return select(ENDED, 0u, overlap(a.now, b.now));
}
