// Search for all overlaps. A wanted pair overlaps.

alias KnownBox = DeviceBox;

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
