// Writes the arguments of an indirect dispatch of this number of workgroups.
fn write_dispatch(at: u32, groups: u32) {
    dispatches[at] = min(groups, GROUPS_PER_ROW);
    dispatches[at + 1u] = (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    dispatches[at + 2u] = 1u;
}
