//! Avril's table 5: forms of output, a byte a pair, a bit a pair or a list, on the CPU and on a device.

use super::avril::output_bytes;
use super::device::{Device, about_bytes, kernels, on_gpu, written};
use super::printed::AVRIL_5;
use super::sheet::Sheet;
use crate::bench::measure::timed;
use crate::output::Failure;
use pbig_core::{Aabb, Coding, GpuOptions, Pair};
use pbig_harness::boxes::cubes;
use pbig_harness::pair_index::pair_of;
use pbig_harness::runner::{Spread, milliseconds};
use serde_json::json;

/// Calls of which the median counts.
const CALLS: usize = 3;

/// A way to write down which pairs overlap, and to read it.
struct Form {
    name: &'static str,
    write: fn(&[Aabb]) -> Vec<u8>,
    read: fn(&[u8], u64) -> Vec<Pair>,
}

const FORMS: [Form; 3] = [
    Form { name: "a byte a pair of boxes", write: write_bytes, read: read_bytes },
    Form { name: "a bit a pair of boxes", write: write_bits, read: read_bits },
    Form { name: "a list of pairs", write: write_list, read: read_list },
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

/// The experiment of table 5 on one thread.
pub(super) fn on_cpu() -> Result<Sheet, Failure> {
    let columns =
        ["objects", "pairs", "form", "bytes written", "ms, tests and output", "ms, pairs read from it"];
    let mut sheet = Sheet::new("Avril table 5: forms of output, CPU", &columns).about(format!(
        "One thread tests every pair and writes what it finds in memory, whence the pairs are read again: medians of \
         {CALLS}. Cubes with a pair each."
    ));
    for (n, ..) in AVRIL_5 {
        let boxes = cubes(n as usize, 1.0, 1.0, 1);
        let mut known: Option<Vec<Pair>> = None;
        for form in &FORMS {
            let (out, pairs, [write, read]) = measure(form, &boxes);
            if known.as_ref().is_some_and(|known| *known != pairs) {
                return Err(Failure::Check(format!("{n} objects: other pairs from {}", form.name)));
            }
            sheet.row(json!([n, pairs.len(), form.name, out.len(), write, read]));
            known = Some(pairs);
        }
    }
    Ok(sheet)
}

/// Returns the written bytes, the pairs read from them, and the milliseconds of both.
fn measure(form: &Form, boxes: &[Aabb]) -> (Vec<u8>, Vec<Pair>, [f64; 2]) {
    let (mut out, mut pairs) = (vec![], vec![]);
    let (mut write, mut read) = (vec![], vec![]);
    for _ in 0..CALLS {
        let (written, ms) = timed(|| (form.write)(boxes));
        write.push(ms);
        let (found, ms) = timed(|| (form.read)(&written, boxes.len() as u64));
        read.push(ms);
        (out, pairs) = (written, found);
    }
    (out, pairs, [write, read].map(|times| Spread::of(times).median))
}

/// The same on a device: bits against a list of pairs.
pub(super) fn on_device(device: &Device) -> Result<Sheet, Failure> {
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
    let mut sheet = Sheet::new("Avril table 5: forms of output, GPU", &columns).about(format!(
        "`Coding::Packed` is a bit a pair of boxes as in 3.4, gathered in a workgroup's memory before it is written; \
         `Plain` is a list of pairs, 8 bytes for each that overlaps. A byte a pair is not there: \
         WGSL stores words, so a thread would have four pairs. Without a grid a device searches up to 1024 \
         boxes here, so 5000 and 7500 have no rows. One pair a box. {} {}",
        about_bytes(),
        device.about()
    ));
    for n in [100, 1000] {
        let forms = [("a bit a pair of boxes", Coding::Packed), ("a list of pairs", Coding::Plain)];
        let configs = forms.map(|(_, coding)| on_gpu(GpuOptions { coding, ..GpuOptions::DEFAULT }));
        for ((form, _), (_, report)) in forms.iter().zip(device.run(&configs, &cubes(n, 1.0, 1.0, 1), 0.1)?) {
            let (kernel, gpu) =
                (kernels(&report, |name| name == "check_all"), report.gpu.clone().unwrap_or_default());
            let [wait, decode] = [gpu.wait, gpu.decode].map(milliseconds);
            let written = written(&report);
            sheet.row(json!([n, report.pairs, form, written, gpu.downloaded, kernel, wait, decode]));
        }
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn every_form_has_the_pairs_of_brute_force_and_the_bytes_of_the_calculation() {
        let boxes = cubes(90, 1.0, 3.0, 1);
        let mut pairs = oracle::pairs(&boxes);
        pairs.sort_unstable();
        let [bytes, bits] = output_bytes(90);
        for (form, size) in FORMS.iter().zip([bytes, bits, 8 * pairs.len() as u64]) {
            let (out, found, _) = measure(form, &boxes);
            assert_eq!((out.len() as u64, &found), (size, &pairs), "{}", form.name);
        }
    }

    #[test]
    fn bits_come_back_as_calculated_whatever_overlaps() {
        let sheet = on_device(&Device::best(true)).expect("a device that works, or none").object();
        for row in sheet["rows"].as_array().expect("rows") {
            let n = row["objects"].as_u64().expect("a number");
            let pairs = oracle::pairs(&cubes(n as usize, 1.0, 1.0, 1)).len() as u64;
            assert_eq!(row["pairs"], pairs);
            // Words are of four bytes; counters and times come back too.
            let bits = output_bytes(n)[1].next_multiple_of(4);
            let written = if row["form"] == "a list of pairs" { 8 * pairs } else { bits };
            assert_eq!(row["bytes written"], written);
            let fetched = row["bytes fetched"].as_u64().expect("a number");
            assert!(fetched >= written && fetched < 2 * written + 2048, "{row}");
        }
    }
}
