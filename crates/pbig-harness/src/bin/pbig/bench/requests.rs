//! The number of requests for memory of a broad phase in steady state. On one thread it should be zero. On several, rayon asks for
//! memory to hand work from thread to thread.

use super::memory::{Motion, Moving};
use super::table::{Row, Target, Unit};
use crate::output::Failure;
use pbig_harness::boxes::BoxSet;
use pbig_harness::counting::{self, requests};

/// Updates before counting, in which buffers grow to their size, and updates that are counted.
const WARM_UP: usize = 400;
const COUNTED: usize = 200;

/// Its rows: on one thread, whose requests are the broad phase's alone, and on all.
pub(super) fn rows(quick: bool) -> Result<Vec<Row>, Failure> {
    let threads = rayon::current_num_threads();
    let sides = [1, threads];
    rows_on(if quick { 5000 } else { 100_000 }, if threads > 1 { &sides } else { &sides[..1] })
}

fn rows_on(boxes: usize, threads: &[usize]) -> Result<Vec<Row>, Failure> {
    counting::switch_on();
    let all = threads.iter().flat_map(|&threads| Motion::STEADY.map(|motion| (threads, motion)));
    all.map(|(threads, (name, motion))| row(name, motion, boxes, threads)).collect()
}

fn row(name: &str, motion: Motion, boxes: usize, threads: usize) -> Result<Row, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Failure::Input(format!("threads: {error}")))?;
    let (count, pairs) =
        pool.install(|| counted(motion, boxes)).map_err(|error| Failure::Input(error.to_string()))?;
    let (on, target) = match threads {
        1 => ("one thread".to_owned(), Some(Target::Nothing)),
        _ => (format!("{threads} threads, with what hands work over from one to another"), None),
    };
    let row =
        Row::new(format!("requests for memory, {name}"), boxes, pairs).unit(Unit::Requests).target(target);
    Ok(row.ours(count as f64).note(format!("in {COUNTED} updates, {on}")))
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
    fn what_an_update_asks_for_would_be_counted() {
        counting::switch_on();
        let before = requests();
        let some = std::hint::black_box(vec![1u8; 100]);
        assert_eq!((requests() - before, some.len()), (1, 100));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
        let of_all = pool.install(|| {
            let before = so_far();
            rayon::broadcast(|_| std::hint::black_box(vec![1u8; 100]));
            so_far() - before
        });
        assert!((2..20).contains(&of_all), "one on each thread, and {of_all} in all");
        let rows = rows_on(5000, &[1, 2]).expect("within the limits");
        assert_eq!(rows.len(), 2 * Motion::STEADY.len());
        // Boxes that circle can have more pairs than in any update before, and then a buffer grows.
        assert_eq!(
            (rows[0].met(), rows[1].met().is_some()),
            (Some(true), true),
            "an update asked for memory"
        );
        assert!(rows[Motion::STEADY.len()..].iter().all(|row| row.met().is_none()));
    }
}
