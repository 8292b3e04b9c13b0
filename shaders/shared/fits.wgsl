// Comparisons of the counts of the map with the room for its lists, and with the tests that the plan promised.

fn has_flag(flag: u32) -> bool {
    return (params.flags & flag) != 0u;
}

fn lists_fit() -> bool {
    return counters.entries <= params.entry_capacity && counters.slots <= params.slot_capacity
        && counters.small_items <= params.small_capacity && counters.large_items <= params.large_capacity;
}

fn tests_fit() -> bool {
    return params.most_tests == 0xffffffffu
        || (counters.tests <= params.most_tests && counters.too_many_tests == 0u);
}
