// Leaders: lanes of a workgroup with the same key share one atomic operation on device memory, so a key that all lanes have
// costs its address one operation a workgroup. Lanes claim places of a small table; the last one leads.

var<workgroup> claims: array<atomic<u32>, LANES>;
var<workgroup> keys: array<u32, LANES>;
// For each leader: the number of its lanes, itself included.
var<workgroup> followers: array<atomic<u32>, LANES>;

// The leader of a lane, and the rank of the lane among the leader's.
struct Following {
    leader: u32,
    rank: u32,
}

// Returns the leader of each lane that takes part. A lane whose place was claimed for another key leads itself. Then
// `followers` is complete.
fn follow(key: u32, lane: u32, takes_part: bool) -> Following {
    let place = (key * 0x9e3779b1u) >> 24u;
    keys[lane] = key;
    atomicStore(&followers[lane], 0u);
    if takes_part {
        atomicStore(&claims[place], lane);
    }
    workgroupBarrier();
    var following = Following(lane, 0u);
    if takes_part {
        let claimed = atomicLoad(&claims[place]);
        following.leader = select(lane, claimed, keys[claimed] == key);
        following.rank = atomicAdd(&followers[following.leader], 1u);
    }
    workgroupBarrier();
    return following;
}
