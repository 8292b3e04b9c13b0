//! Avril's tables 1, 5 and 7 and figures 3 and 4: the matrix of pairs, forms of output, brute force, and a grid.

use super::device::{Device, kernels, on_gpu, same_pairs, written};
use super::finders::{Finders, Way};
use super::printed::{AVRIL_1, AVRIL_5, AVRIL_7, AVRIL_EXAMPLES};
use super::steps::DISTANCE;
use super::{Scale, UNSORTED, effort, once};
use crate::study::{
    ALL_PAIRS_UP_TO, CellRule, INDEX_PAIRS, PbigSettings, SETTINGS, with_gpu_grid, with_our_grid,
};
use pbig_core::layout::{LANES, Params};
use pbig_core::{Aabb, Backend, Coding, Config, GpuOptions, Pair};
use pbig_harness::bench::{Effort, timed};
use pbig_harness::boxes::{cubes, moved};
use pbig_harness::cells;
use pbig_harness::kernels::Bench;
use pbig_harness::output::Failure;
use pbig_harness::pair_index::{index_of, pair_count, pair_of};
use pbig_harness::runner::{Spread, milliseconds};
use pbig_harness::table::Table;

pub(super) fn tables(scale: &Scale, device: &Device) -> Result<Vec<Table>, Failure> {
    let output = [bytes(), forms_on_cpu()?, forms_on_device(device)?];
    let whole = [brute_force(device)?, with_grid(scale, device)?];
    Ok([matrix(device)?].into_iter().chain(output).chain(whole).collect())
}

/// Objects with which table 1's elements are numbers; those of the paper's examples.
const OBJECTS: u64 = AVRIL_EXAMPLES[0].0;

/// Table 1: rows and columns counted from 1, indices from 0, as in the paper. The mapping of all pairs is checked on the CPU, to
/// and fro, and on a device.
fn matrix(device: &Device) -> Result<Table, Failure> {
    let columns =
        ["row", "column", "printed", "that number", "index, ours", "pair of the printed index, ours"];
    let mut table = Table::new("Avril table 1: the matrix of pairs", columns);
    let of_table =
        AVRIL_1.iter().map(|(pair, text, printed)| (pair(OBJECTS), (*text).to_owned(), printed(OBJECTS)));
    let of_examples = AVRIL_EXAMPLES.iter().map(|&(_, k, pair)| (pair, format!("{k} (section 3.1)"), k));
    for ((a, b), text, printed) in of_table.chain(of_examples) {
        let pair = (printed < pair_count(OBJECTS)).then(|| pair_of(printed, OBJECTS));
        let pair = pair.map_or("none".to_owned(), |(a, b)| format!("({}, {})", a + 1, b + 1));
        table.row(cells![a, b, text, printed, index_of(a - 1, b - 1, OBJECTS), pair]);
    }
    let there = |k: u64| index_of(pair_of(k, OBJECTS).0, pair_of(k, OBJECTS).1, OBJECTS) == k;
    let wrong = (0..pair_count(OBJECTS)).find(|&k| !there(k));
    let on_device = if device.has_adapter() { all_on_device()? } else { vec![] };
    let wrong = wrong.or((0..).zip(on_device).find(|&(k, pair)| pair != pair_of(k, OBJECTS)).map(|(k, _)| k));
    wrong.map_or(Ok(table), |k| Err(Failure::Check(format!("index {k} of {OBJECTS} boxes is wrong"))))
}

/// Returns the pair of every index, by the mapping of the check kernels.
fn all_on_device() -> Result<Vec<(u64, u64)>, Failure> {
    let count = pair_count(OBJECTS) as u32;
    let params = Params { boxes: OBJECTS as u32, cells: count, ..Params::default() };
    let bindings = [bytemuck::bytes_of(&params).to_vec(), vec![0; 12 * count as usize]];
    let options = GpuOptions::DEFAULT;
    let run = |bench: Bench| bench.run(&INDEX_PAIRS, &options, false, &bindings, count.div_ceil(LANES));
    let found = Bench::new().and_then(run).map_err(|error| Failure::Input(error.to_string()))?;
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&found[1]);
    Ok(words.chunks_exact(3).map(|words| (words[1].into(), words[2].into())).collect())
}

/// Bytes that come back with a byte a pair, and with a bit (3.4).
fn output_bytes(n: u64) -> [u64; 2] {
    [pair_count(n), pair_count(n).div_ceil(8)]
}

/// Table 5 and figure 3: bytes by calculation, and rates over the printed output time.
fn bytes() -> Table {
    let columns = [
        "objects",
        "pairs tested",
        "bytes, a byte a pair",
        "bytes, a bit a pair",
        "kernel printed, ms: byte",
        "kernel printed, ms: bit",
        "output printed, us: byte",
        "output printed, us: bit",
        "GB/s printed: byte",
        "GB/s printed: bit",
        "tests/s printed",
    ];
    let mut table = Table::new("Avril table 5 and figure 3: a byte or a bit a pair", columns);
    for (n, byte, bit) in AVRIL_5 {
        let [bytes, bits] = output_bytes(n);
        let rate = |bytes: u64, us: f64| bytes as f64 / us / 1e3;
        let sizes = cells![n, pair_count(n), bytes, bits, byte[0], bit[0], byte[1], bit[1]];
        let tests = pair_count(n) as f64 / (bit[0] / 1e3);
        table.row([sizes, cells![rate(bytes, byte[1]), rate(bits, bit[1]), tests]].concat());
    }
    table
}

/// A way to write down which pairs overlap, and to read it.
type Form = (&'static str, fn(&[Aabb]) -> Vec<u8>, fn(&[u8], u64) -> Vec<Pair>);

const FORMS: [Form; 3] = [
    ("a byte a pair of boxes", write_bytes, read_bytes),
    ("a bit a pair of boxes", write_bits, read_bits),
    ("a list of pairs", write_list, read_list),
];

/// Every pair in the order of its index, and whether it overlaps.
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
    let ids = |pair: Pair| [pair.a.to_le_bytes(), pair.b.to_le_bytes()];
    tests(boxes).filter(|(_, hit)| *hit).flat_map(|(pair, _)| ids(pair)).flatten().collect()
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
    let id = |bytes: &[u8]| bytes.iter().rev().fold(0, |id, byte| id << 8 | u32::from(*byte));
    out.chunks_exact(8).map(|pair| Pair::new(id(&pair[..4]), id(&pair[4..]))).collect()
}

/// Table 5 on one thread: every pair is tested and written in memory, whence the pairs are read again; medians of 3 calls.
fn forms_on_cpu() -> Result<Table, Failure> {
    let columns =
        ["objects", "pairs", "form", "bytes written", "ms, tests and output", "ms, pairs read from it"];
    let mut table = Table::new("Avril table 5: forms of output, CPU", columns);
    for (n, ..) in AVRIL_5 {
        let boxes = cubes(n as usize, 1.0, 1.0, 1);
        let mut known: Option<Vec<Pair>> = None;
        for (name, write, read) in FORMS {
            let (mut times, mut found) = ([vec![], vec![]], (vec![], vec![]));
            for _ in 0..3 {
                let (written, ms) = timed(|| write(&boxes));
                let (pairs, read_ms) = timed(|| read(&written, n));
                times.iter_mut().zip([ms, read_ms]).for_each(|(times, ms)| times.push(ms));
                found = (written, pairs);
            }
            let [write_ms, read_ms] = times.map(|times| Spread::of(times).median);
            let (out, pairs) = found;
            if known.as_ref().is_some_and(|known| *known != pairs) {
                return Err(Failure::Check(format!("{n} objects: other pairs from {name}")));
            }
            table.row(cells![n, pairs.len(), name, out.len(), write_ms, read_ms]);
            known = Some(pairs);
        }
    }
    Ok(table)
}

/// The same on a device, without a grid: bits (`Coding::Packed`) against a list of pairs (`Plain`).
fn forms_on_device(device: &Device) -> Result<Table, Failure> {
    let columns = [
        "objects",
        "pairs",
        "form",
        "bytes written",
        "bytes fetched",
        "ms of the kernel `check_all`",
        "ms, host waits",
        "ms, host decodes",
    ];
    let mut table = Table::new("Avril table 5: forms of output, GPU", columns);
    for n in [100, 1000] {
        let forms = [("a bit a pair of boxes", Coding::Packed), ("a list of pairs", Coding::Plain)];
        let configs = forms.map(|(_, coding)| on_gpu(GpuOptions { coding, ..GpuOptions::DEFAULT }));
        for ((form, _), (_, report)) in forms.iter().zip(device.run(&configs, &cubes(n, 1.0, 1.0, 1), 0.1)?) {
            let kernel = kernels(&report, |name| name == "check_all");
            let gpu = report.gpu.clone().unwrap_or_default();
            let [wait, decode] = [gpu.wait, gpu.decode].map(milliseconds);
            table.row(cells![n, report.pairs, *form, written(&report), gpu.downloaded, kernel, wait, decode]);
        }
    }
    Ok(table)
}

/// Figure 4: brute force by number of objects, on one thread, and on a device up to 1024 boxes.
fn brute_force(device: &Device) -> Result<Table, Failure> {
    let columns = [
        "objects",
        "tests",
        "bytes up",
        "bytes back, a bit a pair",
        "ms, brute force, CPU",
        "tests/s, CPU",
        "ms, GPU",
    ];
    let mut table = Table::new("Avril figure 4: brute force", columns);
    for n in [100usize, 500, 1000, 2500, 5000] {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let gpu = if n <= 1024 { device.run(&[on_gpu(GpuOptions::DEFAULT)], &boxes, 0.1)? } else { vec![] };
        let config = Config { backend: Backend::Brute, ..UNSORTED };
        same_pairs(&gpu, once(config, &boxes)?.pairs)?;
        let ms = Finders::new([config], None, [moved(&boxes, 0.1, 2), boxes]).times(effort(n))?[0];
        let tests = pair_count(n as u64);
        let sizes = cells![n, tests, 24 * n, output_bytes(n as u64)[1]];
        table.row([sizes, cells![ms, tests as f64 / ms * 1e3, gpu.first().map(|(ms, _)| *ms)]].concat());
    }
    Ok(table)
}

/// Table 7: with and without a grid, whole calls from nothing, all moved.
fn with_grid(scale: &Scale, device: &Device) -> Result<Table, Failure> {
    let columns = [
        "objects",
        "pairs",
        "ms printed: without grid",
        "ms printed: with grid",
        "ms, CPU: brute force",
        "ms, CPU: our grid",
        "ms, CPU: Avril's cells, one thread",
        "ms, GPU: without grid",
        "ms, GPU: with grid",
    ];
    let mut table = Table::new("Avril table 7: with and without a grid", columns);
    let sides: [Way; 3] = [
        Config { backend: Backend::Brute, ..UNSORTED }.into(),
        with_our_grid(UNSORTED).into(),
        PbigSettings { cell_rule: CellRule::Density, ..SETTINGS }.into(),
    ];
    for (n, without, with) in AVRIL_7 {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let on = |all_pairs_up_to| with_gpu_grid(on_gpu(GpuOptions::DEFAULT), &SETTINGS, all_pairs_up_to);
        let wanted = [on(0), on(ALL_PAIRS_UP_TO)];
        let gpu = device.run(&wanted[..if n <= 1024 { 2 } else { 1 }], &boxes, DISTANCE)?;
        let pairs = once(UNSORTED, &boxes)?.pairs;
        same_pairs(&gpu, pairs)?;
        let mut finders = Finders::new(sides, None, [moved(&boxes, DISTANCE, 2), boxes]);
        let cpu = finders.times(Effort::new(scale.quick))?;
        finders.pairs()?;
        let gpu_ms = |i: usize| gpu.get(i).map(|(ms, _)| *ms);
        table.row(cells![n, pairs, without, with, cpu[0], cpu[1], cpu[2], gpu_ms(1), gpu_ms(0)]);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn every_form_has_the_pairs_of_brute_force_and_the_bytes_of_the_calculation() {
        assert_eq!((output_bytes(1000), output_bytes(7)), ([499_500, 62_438], [21, 3]));
        let boxes = cubes(90, 1.0, 3.0, 1);
        let mut pairs = oracle::pairs(&boxes);
        pairs.sort_unstable();
        let [bytes, bits] = output_bytes(90);
        for ((name, write, read), size) in FORMS.iter().zip([bytes, bits, 8 * pairs.len() as u64]) {
            let out = write(&boxes);
            assert_eq!((out.len() as u64, &read(&out, 90)), (size, &pairs), "{name}");
        }
    }
}
