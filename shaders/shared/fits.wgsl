// Comparisons of the counts of the map with the room for its lists, and with the tests that the plan promised; what the device
// dispatches then.

fn has_flag(flag: u32) -> bool {
    return (params.flags & flag) != 0u;
}

// Returns the arguments of an indirect dispatch of this number of workgroups.
fn dispatch_of(groups: u32) -> array<u32, 3> {
    return array<u32, 3>(min(groups, GROUPS_PER_ROW), (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW, 1u);
}

fn lists_fit() -> bool {
    return counters.entries <= params.entry_capacity && counters.slots <= params.slot_capacity
        && counters.small_items <= params.small_capacity && counters.large_items <= params.large_capacity;
}

fn tests_fit() -> bool {
    return params.most_tests == 0xffffffffu
        || (counters.tests <= params.most_tests && counters.too_many_tests == 0u);
}
