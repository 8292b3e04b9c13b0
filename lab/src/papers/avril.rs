//! Avril's tables 5, 6 and 7 and figures 3 to 6: forms of output, brute force, a grid, and steps.

use super::OUR_GRID;
use super::printed::*;
use super::sides::{Setup, Way, effort, race};
use crate::UNSORTED;
use crate::alone::{NAMES, alone};
use pbig_core::{Aabb, Backend, Config, Pair};
use pbig_gpu::GpuOptions;
use pbig_harness::gpu_race;
use pbig_harness::pair_index::{pair_count, pair_of};
use pbig_harness::prelude::*;

/// The distance that cubes with edges of 1 move in a step, along each axis.
const DISTANCE: f32 = 0.1;

/// Boxes up to which a device tests every pair by default.
const ALL_PAIRS: usize = GpuOptions::DEFAULT.all_pairs_up_to as usize;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    Ok(vec![forms_on_cpu()?, brute_force_and_grid(setup)?, steps(setup)?])
}

/// Returns the bytes that come back with a byte a pair, and with a bit (3.4).
fn output_bytes(n: u64) -> [u64; 2] {
    [pair_count(n), pair_count(n).div_ceil(8)]
}

/// A way to write down which pairs overlap, and to read it.
type Form = (&'static str, fn(&[Aabb]) -> Vec<u8>, fn(&[u8], u64) -> Vec<Pair>);

const FORMS: [Form; 3] = [
    ("a byte a pair of boxes", write_bytes, read_bytes),
    ("a bit a pair of boxes", write_bits, read_bits),
    ("a list of pairs", write_list, read_list),
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

fn pair_at(k: u64, n: u64) -> Pair {
    let (a, b) = pair_of(k, n);
    Pair::new(a as u32, b as u32)
}

fn read_bytes(out: &[u8], n: u64) -> Vec<Pair> {
    (0..).zip(out).filter(|(_, byte)| **byte != 0).map(|(k, _)| pair_at(k, n)).collect()
}

fn read_bits(out: &[u8], n: u64) -> Vec<Pair> {
    let of_byte =
        |(i, &byte): (u64, &u8)| (0..8).filter(move |bit| byte >> bit & 1 != 0).map(move |bit| 8 * i + bit);
    (0..).zip(out).flat_map(of_byte).map(|k| pair_at(k, n)).collect()
}

fn read_list(out: &[u8], _: u64) -> Vec<Pair> {
    bytemuck::pod_collect_to_vec(out)
}

/// Table 5 and figure 3 on one thread: every pair is tested and written in memory, whence the pairs are read again. Printed rates
/// are bytes over the output's time, and tests over the kernel's.
fn forms_on_cpu() -> Result<Table, Failure> {
    let columns = "objects | pairs | form | bytes written | ms, tests and output | ms, pairs read from it | \
        kernel printed, ms | output printed, us | GB/s printed | tests/s printed";
    let mut table = Table::new("Avril table 5 and figure 3: forms of output, CPU", columns);
    for (n, byte, bit) in AVRIL_5 {
        let boxes = cubes(n as usize, 1.0, 1.0, 1);
        let known = read_list(&write_list(&boxes), n);
        for ((name, write, read), printed) in FORMS.into_iter().zip([Some(byte), Some(bit), None]) {
            let mut found = (write(&boxes), vec![]);
            let ms = medians(&mut found, 2, effort(boxes.len()), unprepared, |(out, pairs), side| {
                let write = || *out = write(&boxes);
                Ok(if side == 0 { timed(write).1 } else { timed(|| *pairs = read(out, n)).1 })
            })?;
            let (bytes, pairs) = (found.0.len(), found.1);
            check(pairs == known, || format!("{n} objects: other pairs from {name}"))?;
            let tests = pair_count(n) as f64;
            let rates = |[kernel, us]: [f64; 2]| [kernel, us, bytes as f64 / us / 1e3, tests / kernel * 1e3];
            let printed = printed.into_iter().flat_map(rates);
            table.row(cells![n, pairs.len(), name, bytes, ..ms, ..printed]);
        }
    }
    Ok(table)
}

const BRUTE: Way = Way::Finder(Config { backend: Backend::Brute, ..UNSORTED });

/// Figure 4, brute force by number of objects, and table 7, with and without a grid: whole calls from nothing, all moved. On a
/// device brute force takes up to 1024 boxes.
fn brute_force_and_grid(setup: &Setup) -> Result<Table, Failure> {
    let columns = "objects | tests | bytes up | bytes back, a bit a pair | pairs | ms, CPU: brute force | ms, CPU: our grid | \
        ms, CPU: Avril's cells, one thread | tests/s, CPU: brute force | ms printed: without grid | \
        ms printed: with grid | ms, GPU: with grid | ms, GPU: without grid";
    let mut table = Table::new("Avril figure 4 and table 7: brute force, with and without a grid", columns);
    let on_device = [0, ALL_PAIRS as u32]
        .map(|all_pairs_up_to| Way::Gpu(GpuOptions { all_pairs_up_to, ..GpuOptions::DEFAULT }));
    for n in [100usize, 500, 1000, 2500, 5000, 10_000] {
        let (boxes, tests) = (cubes(n, 1.0, 1.0, 1), pair_count(n as u64));
        let gpu = setup.run(&on_device[..1 + usize::from(n <= ALL_PAIRS)], &boxes, DISTANCE)?;
        let cpu = race(&[BRUTE, Way::Finder(OUR_GRID), Way::Avril], None, boxes, DISTANCE, effort(n))?;
        let bytes = [24 * n, output_bytes(n as u64)[1] as usize];
        let ms = cpu.iter().map(|call| call.median);
        let tests_a_second = tests as f64 / cpu[0].median * 1e3;
        let printed = AVRIL_7.iter().find(|row| row.0 == n);
        let printed = [printed.map(|row| row.1), printed.map(|row| row.2)];
        let on_device = gpu.iter().map(|call| call.ms);
        let counts = cells![n, tests, ..bytes, cpu[0].report.pairs];
        table.row(cells![..counts, ..ms, tests_a_second, ..printed, ..on_device]);
    }
    Ok(table)
}

/// Table 6 and figures 5 and 6: a step in which all or a share move. Ours: cubes with a pair each that move by up to a tenth of
/// their edge: `BroadPhase::set_many`, then `update`, events included, beside a search from nothing; on the CPU means, on a
/// device medians of a few updates.
fn steps(setup: &Setup) -> Result<Table, Failure> {
    let columns = "objects | share moved | side | pairs | boxes up to date, ms | grid (ours: plan and map), ms | \
        search (ours: check, emit, diff), ms | whole, ms | updates";
    let mut table = Table::new("Avril table 6, figures 5 and 6: a step", columns);
    let (n, most) = if setup.quick { (10_000, 100_000) } else { (100_000, usize::MAX) };
    let sizes = AVRIL_6.into_iter().filter(|(n, _)| *n <= most).map(|(n, printed)| (n, 1.0, Some(printed)));
    for (n, share, printed) in sizes.chain([0.75, 0.5, 0.25, 0.1, 0.01].map(|share| (n, share, None))) {
        if let Some(printed) = printed {
            table.row(cells![n, share, "printed", (), ..printed]);
        }
        let boxes = || cubes(n, 1.0, 1.0, 1);
        for (side, events) in [("ours, CPU", true), ("ours, CPU, from nothing", false)] {
            let ours = alone(events, boxes(), (share, DISTANCE), Effort::new(setup.quick))?;
            let of = |wanted: &[&str]| -> f64 {
                let times = NAMES.iter().zip(ours.mean);
                times.filter(|(name, _)| wanted.contains(name)).map(|(_, ms)| ms).sum()
            };
            let parts = [of(&["set"]), of(&["plan", "map"]), of(&["check", "emit", "diff"])];
            table.row(cells![n, share, side, ours.pairs, ..parts, ours.mean[0], ours.chosen]);
        }
        if let Some(gpu) = setup.for_boxes(n) {
            let raced = gpu_race::race(gpu, boxes(), share, DISTANCE)?;
            table.row(cells![n, share, "ours, GPU", raced.pairs, ..[(); 3], raced.ms[1]]);
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn every_form_has_the_oracles_pairs_and_the_calculated_bytes() {
        assert_eq!((output_bytes(1000), output_bytes(7)), ([499_500, 62_438], [21, 3]));
        let boxes = cubes(90, 1.0, 3.0, 1);
        let pairs = oracle::pairs(&boxes);
        let [bytes, bits] = output_bytes(90);
        for ((name, write, read), size) in FORMS.iter().zip([bytes, bits, 8 * pairs.len() as u64]) {
            let out = write(&boxes);
            assert_eq!((out.len() as u64, &read(&out, 90)), (size, &pairs), "{name}");
        }
    }
}
