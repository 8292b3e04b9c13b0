//! The number of requests for memory of a broad phase in steady state. On one thread it should be zero. On several, rayon asks for
//! memory to hand work from thread to thread.

use super::memory::{Motion, Moving};
use pbig_harness::bench::alone;
use pbig_harness::boxes::BoxSet;
use pbig_harness::counting::{self, requests};
use pbig_harness::output::Failure;
use pbig_harness::table::Table;

/// Updates before counting, in which buffers grow to their size, and updates that are counted.
const WARM_UP: usize = 400;
const COUNTED: usize = 200;

/// Appends the counts on one thread, which are the broad phase's alone, and on all.
pub(super) fn rows(quick: bool, table: &mut Table) -> Result<(), Failure> {
    counting::switch_on();
    let (boxes, all) = (if quick { 5000 } else { 100_000 }, rayon::current_num_threads());
    let threads: &[usize] = if all > 1 { &[1, all] } else { &[1] };
    for (&threads, (name, motion)) in
        threads.iter().flat_map(|threads| Motion::STEADY.map(|motion| (threads, motion)))
    {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| Failure::Input(format!("threads: {error}")))?;
        let (count, pairs) = pool.install(|| counted(motion, boxes))?;
        let case = format!("requests for memory, {name}, {threads} threads, in {COUNTED} updates");
        table.row(alone(&case, boxes, pairs, "requests", Some(count as f64)));
    }
    Ok(())
}

/// Requests of all threads of the pool in some updates, and the pairs afterwards.
fn counted(motion: Motion, boxes: usize) -> Result<(u64, u64), pbig_core::Error> {
    let boxes = BoxSet::named("unit").expect("a set of the harness").boxes(boxes, 1);
    let mut moving = Moving::new(&boxes, motion)?;
    (0..WARM_UP).try_for_each(|_| moving.update())?;
    // To ask all threads takes some, too.
    let asking = so_far();
    let before = so_far();
    (0..COUNTED).try_for_each(|_| moving.update())?;
    let count = so_far() - before;
    Ok((count.saturating_sub(before - asking), moving.pairs() as u64))
}

fn so_far() -> u64 {
    if rayon::current_num_threads() == 1 {
        requests()
    } else {
        rayon::broadcast(|_| requests()).into_iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_update_that_asks_for_memory_would_be_counted_and_none_does_on_one_thread() {
        counting::switch_on();
        let before = requests();
        let some = std::hint::black_box(vec![1u8; 100]);
        assert_eq!((requests() - before, some.len()), (1, 100));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        // Boxes that circle can have more pairs than in any update before, and then a buffer grows.
        let found = pool.install(|| counted(Motion::STEADY[0].1, 5000)).expect("within the limits");
        assert!(found.0 == 0 && found.1 > 0, "{found:?}");
    }
}
