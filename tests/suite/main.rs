//! One test binary: linking rapier once is what keeps the suite fast to build.

mod between;
mod bounded;
mod calls;
mod checked;
mod differences;
mod documents;
mod drop_in;
mod explain;
mod finder;
mod follower;
mod for_each;
mod gpu;
mod incremental;
mod kernels;
mod look_ups;
mod order;
mod peak;
mod planted;
mod queries;
mod random_worlds;
mod restore;
mod stress;
mod upstream;
mod worlds;

use pbig_harness::counting::Counting;

#[global_allocator]
static COUNTING: Counting = Counting;
