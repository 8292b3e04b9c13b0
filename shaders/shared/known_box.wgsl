// The boxes as the host has left them, and as the checks need them.

// Returns true if this update has changed a box, or if the device got the box now and before.
fn has_changed(id: u32) -> bool {
    return id >= params.known || ((changed[id / 32u] >> (id % 32u)) & 1u) != 0u;
}

fn known_box(id: u32) -> KnownBox {
    return renewed(boxes[id], has_changed(id));
}
