// As block_scan.wgsl, with subgroups: 2 barriers instead of 17. Lanes are ordered by the first lane of their subgroup, then
// by their rank within it. The order is the same in every call. No size or numbering of subgroups is assumed.

var<workgroup> scan_space: array<u32, LANES>;

fn block_scan(value: u32, lane: u32) -> u32 {
    // Reconverges lanes that the caller's branches separated.
    workgroupBarrier();
    let leader = subgroupMin(lane);
    let rank = subgroupExclusiveAdd(1u);
    let size = subgroupAdd(1u);
    let before = subgroupExclusiveAdd(value);
    let sum = subgroupAdd(value);
    scan_space[lane] = select(0u, sum, lane == leader);
    workgroupBarrier();
    var part = 0u;
    // All lanes take equally many turns, so none leaves the subgroup early.
    for (var i = rank; i < LANES; i += size) {
        part += select(0u, scan_space[i], i < leader);
    }
    return subgroupAdd(part) + before;
}

fn block_sum() -> u32 {
    var sum = 0u;
    let size = subgroupAdd(1u);
    for (var i = subgroupExclusiveAdd(1u); i < LANES; i += size) {
        sum += scan_space[i];
    }
    let all = subgroupAdd(sum);
    workgroupBarrier();
    return all;
}
