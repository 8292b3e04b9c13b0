//! The memory that a thread holds: requested less freed bytes.

use pbig_harness::counting::Counting;
pub(crate) use pbig_harness::counting::{held, largest};

#[global_allocator]
static COUNTING: Counting<true> = Counting;

#[test]
fn it_is_this_allocator_that_counts() {
    let before = held();
    let some = std::hint::black_box(vec![1u8; 1000]);
    assert_eq!(held() - before, 1000);
    drop(some);
}
