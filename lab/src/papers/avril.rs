//! Avril's tables 5, 6 and 7 and figures 3 to 6: forms of output, brute force, a grid, and steps.

use super::OUR_GRID;
use super::printed::*;
use super::sides::{Setup, Way, effort, race};
use crate::UNSORTED;
use pbig_core::{Aabb, Backend, BroadPhase, Config, Finder, Pair, ProxyFilter};
use pbig_harness::gpu_race;
use pbig_harness::pair_index::pair_count;
use pbig_harness::prelude::*;

/// The distance that cubes with edges of 1 move in a step, along each axis.
const DISTANCE: f32 = 0.1;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    Ok(vec![forms_on_cpu()?, brute_force_and_grid()?, steps(setup)?])
}

/// Returns the bytes that come back with a byte a pair, and with a bit (3.4).
fn output_bytes(n: u64) -> [u64; 2] {
    [pair_count(n), pair_count(n).div_ceil(8)]
}

/// A way to write down which pairs overlap.
type Form = (&'static str, fn(&[Aabb]) -> Vec<u8>);

const FORMS: [Form; 3] = [
    ("a byte a pair of boxes", write_bytes),
    ("a bit a pair of boxes", write_bits),
    ("a list of pairs", write_list),
];

/// Returns every pair in the order of its index, and true if it overlaps.
fn tests(boxes: &[Aabb]) -> impl Iterator<Item = (Pair, bool)> {
    let pairs = (0..boxes.len()).flat_map(|a| (a + 1..boxes.len()).map(move |b| (a, b)));
    pairs.map(|(a, b)| (Pair::new(a as u32, b as u32), boxes[a].overlaps(&boxes[b])))
}

fn write_bytes(boxes: &[Aabb]) -> Vec<u8> {
    let mut out = vec![0; output_bytes(boxes.len() as u64)[0] as usize];
    out.iter_mut().zip(tests(boxes)).for_each(|(byte, (_, hit))| *byte = u8::from(hit));
    out
}

/// As in 3.4, with no thread beside this one.
fn write_bits(boxes: &[Aabb]) -> Vec<u8> {
    let mut out = vec![0; output_bytes(boxes.len() as u64)[1] as usize];
    (0..).zip(tests(boxes)).for_each(|(k, (_, hit)): (usize, _)| out[k / 8] |= u8::from(hit) << (k % 8));
    out
}

fn write_list(boxes: &[Aabb]) -> Vec<u8> {
    let pairs: Vec<Pair> = tests(boxes).filter(|(_, hit)| *hit).map(|(pair, _)| pair).collect();
    bytemuck::cast_slice(&pairs).to_vec()
}

/// Table 5 and figure 3 on one thread: every pair is tested and written in memory.
fn forms_on_cpu() -> Result<Table, Failure> {
    let columns = "objects | pairs | form | bytes written | ms, tests and output | kernel printed, ms | output printed, us";
    let mut table = Table::new("Avril table 5 and figure 3: forms of output, CPU", columns);
    for (n, byte, bit) in AVRIL_5 {
        let boxes = cubes(n as usize, 1.0, 1.0, 1);
        let pairs = write_list(&boxes).len() / size_of::<Pair>();
        for ((name, write), printed) in FORMS.into_iter().zip([Some(byte), Some(bit), None]) {
            let mut out = vec![];
            let run = |out: &mut Vec<u8>, _| Ok(timed(|| *out = write(&boxes)).1);
            let ms = medians(&mut out, 1, effort(boxes.len()), unprepared, run)?;
            table.row(cells![n, pairs, name, out.len(), ..ms, ..printed.into_iter().flatten()]);
        }
    }
    Ok(table)
}

const BRUTE: Way = Way::Finder(Config { backend: Backend::Brute, ..UNSORTED });

/// Figure 4, brute force by number of objects, and table 7, with and without a grid: whole calls from nothing, all moved.
fn brute_force_and_grid() -> Result<Table, Failure> {
    let columns = "objects | tests | bytes up | bytes back, a bit a pair | pairs | ms, CPU: brute force | ms, CPU: our grid | \
        ms, CPU: Avril's cells, one thread | tests/s, CPU: brute force | ms printed: without grid | ms printed: with grid";
    let mut table = Table::new("Avril figure 4 and table 7: brute force, with and without a grid", columns);
    for n in [100usize, 500, 1000, 2500, 5000, 10_000] {
        let (boxes, tests) = (cubes(n, 1.0, 1.0, 1), pair_count(n as u64));
        let cpu = race(&[BRUTE, Way::Finder(OUR_GRID), Way::Avril], None, boxes, DISTANCE, effort(n))?;
        let bytes = [24 * n, output_bytes(n as u64)[1] as usize];
        let ms = cpu.iter().map(|call| call.median);
        let tests_a_second = tests as f64 / cpu[0].median * 1e3;
        let printed = AVRIL_7.iter().find(|row| row.0 == n);
        let printed = [printed.map(|row| row.1), printed.map(|row| row.2)];
        let counts = cells![n, tests, ..bytes, cpu[0].report.pairs];
        table.row(cells![..counts, ..ms, tests_a_second, ..printed]);
    }
    Ok(table)
}

/// Table 6 and figures 5 and 6: a step in which all or a share move. Ours: cubes with a pair each that move by up to a tenth of
/// their edge: `BroadPhase::set_many`, then `update`, events included, beside a search from nothing; on the CPU means, on a
/// device medians of a few updates.
fn steps(setup: &Setup) -> Result<Table, Failure> {
    let mut table = Table::new(
        "Avril table 6, figures 5 and 6: a step",
        "objects | share moved | side | pairs | whole, ms",
    );
    let (n, most) = if setup.quick { (10_000, 100_000) } else { (100_000, usize::MAX) };
    let sizes = AVRIL_6.into_iter().filter(|(n, _)| *n <= most).map(|(n, printed)| (n, 1.0, Some(printed)));
    for (n, share, printed) in sizes.chain([0.75, 0.5, 0.25, 0.1, 0.01].map(|share| (n, share, None))) {
        if let Some(printed) = printed {
            table.row(cells![n, share, "printed", (), printed]);
        }
        let boxes = || cubes(n, 1.0, 1.0, 1);
        let (pairs, ms) = step(Wander::new(boxes(), share, DISTANCE), Effort::new(setup.quick))?;
        for (side, ms) in ["ours, CPU", "ours, CPU, from nothing"].into_iter().zip(ms) {
            table.row(cells![n, share, side, pairs, ms.mean]);
        }
        if let Some(gpu) = setup.for_boxes(n) {
            let raced = gpu_race::race(gpu, boxes(), share, DISTANCE)?;
            table.row(cells![n, share, "ours, GPU", raced.pairs, raced.ms[1]]);
        }
    }
    Ok(table)
}

/// Measures an update, and a search from nothing, in turn. Returns the pairs, too.
fn step(wander: Wander, effort: Effort) -> Result<(usize, Vec<Took>), Failure> {
    let (mut finder, mut broad_phase) = (Finder::new(UNSORTED), BroadPhase::new(UNSORTED)?);
    let all: Vec<u32> = (0..wander.boxes.len() as u32).collect();
    let prepare = |(wander, moved): &mut (Wander, Vec<u32>), round| {
        let now = wander.step(round);
        // In the first round all are new.
        if round > 0 {
            *moved = now;
        }
    };
    let took = measured(&mut (wander, all), 2, effort, prepare, |(wander, moved), side| {
        let of = |id: u32| Some((wander.boxes[id as usize], ProxyFilter::ALL));
        let (done, ms) = timed(|| match side {
            0 => broad_phase.set_many(moved, of).and_then(|()| broad_phase.update().map(|_| ())),
            _ => finder.find(&wander.boxes).map(|_| ()),
        });
        Ok(done.map(|()| ms)?)
    })?;
    check(broad_phase.pair_count() == finder.pairs().len(), || "an update and a search differ".into())?;
    Ok((finder.pairs().len(), took))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;
    use pbig_harness::pair_index::index_of;

    #[test]
    fn every_form_has_the_oracles_pairs_and_the_calculated_bytes() {
        assert_eq!((output_bytes(1000), output_bytes(7)), ([499_500, 62_438], [21, 3]));
        let boxes = cubes(90, 1.0, 3.0, 1);
        let pairs = oracle::pairs(&boxes);
        let [bytes, bits] = output_bytes(90);
        for ((name, write), size) in FORMS.iter().zip([bytes, bits, 8 * pairs.len() as u64]) {
            assert_eq!(write(&boxes).len() as u64, size, "{name}");
        }
        assert_eq!(write_list(&boxes), bytemuck::cast_slice::<Pair, u8>(&pairs));
        let places: Vec<u64> = pairs.iter().map(|pair| index_of(pair.a.into(), pair.b.into(), 90)).collect();
        let [by_byte, by_bit] = [write_bytes(&boxes), write_bits(&boxes)];
        for k in 0..bytes {
            let (hit, byte, bit) =
                (places.contains(&k), by_byte[k as usize], by_bit[k as usize / 8] >> (k % 8));
            assert_eq!((byte, bit & 1), (u8::from(hit), u8::from(hit)), "index {k}");
        }
    }
}
