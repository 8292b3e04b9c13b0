// Search for all overlaps. A wanted pair overlaps. Boxes stay as they came up, in floats, and kernels convert what they read:
// to store all boxes costs more.

alias KnownBox = DeviceBox;

// Number of boxes of small cells that fit workgroup memory.
const STAGED = 256u;

// Returns true if `locate` stores the box as the checks need it.
fn is_stale(one: KnownBox, has_changed: bool) -> bool {
    return false;
}

// Returns a box as the checks need it.
fn renewed(one: KnownBox, has_changed: bool) -> KnownBox {
    return ordered_box(one);
}

// Returns a box that `locate` has seen, as the checks need it.
fn checked_box(one: KnownBox) -> KnownBox {
    return ordered_box(one);
}

// Returns the box whose cells the known box is sorted into.
fn bounds_of(one: KnownBox) -> DeviceBox {
    return one;
}

fn has_moved(one: KnownBox) -> bool {
    return false;
}

// Returns true if a pair may be wanted, by the marks of both entries.
fn may_be_wanted(marks: u32) -> bool {
    return true;
}

// Returns true if a pair is wanted, by its boxes.
fn is_wanted(a: KnownBox, b: KnownBox) -> bool {
    return overlap(a, b);
}

// Returns the mark of a wanted pair in the output.
fn mark_of(a: KnownBox, b: KnownBox) -> u32 {
    return 0u;
}
