//! Avril's table 1: the matrix of pairs, by our mapping, on the CPU and as a kernel.

use super::device::Device;
use super::printed::{AVRIL_1, AVRIL_EXAMPLES};
use super::sheet::{Sheet, thousands};
use crate::output::Failure;
use pbig_core::GpuOptions;
use pbig_core::layout::{LANES, Params};
use pbig_harness::kernels::Bench;
use pbig_harness::pair_index::{index_of, pair_count, pair_of};
use serde_json::json;

/// Objects with which the table's elements are numbers; those of the paper's examples.
const OBJECTS: u64 = AVRIL_EXAMPLES[0].0;

/// One element: the pair counted from 1, what the paper has there, and that as a number.
struct Element {
    pair: (u64, u64),
    text: String,
    printed: u64,
}

fn elements() -> Vec<Element> {
    let of_table = AVRIL_1.iter().map(|(pair, text, printed)| Element {
        pair: pair(OBJECTS),
        text: (*text).to_owned(),
        printed: printed(OBJECTS),
    });
    let of_examples = AVRIL_EXAMPLES.iter().map(|&(_, k, pair)| Element {
        pair,
        text: format!("{k} (section 3.1)"),
        printed: k,
    });
    of_table.chain(of_examples).collect()
}

/// The pair of an index, both counted as the paper does; none beyond the last index.
fn pair_from_one(k: u64) -> Option<(u64, u64)> {
    (k < pair_count(OBJECTS)).then(|| pair_of(k, OBJECTS)).map(|(a, b)| (a + 1, b + 1))
}

pub(super) fn table(device: &Device) -> Result<Sheet, Failure> {
    let columns =
        ["row", "column", "printed", "that number", "index, ours", "pair of the printed index, ours"];
    let mut sheet = Sheet::new("Avril table 1: the matrix of pairs", &columns)
        .about(format!("n = {OBJECTS}, rows and columns counted from 1, indices from 0, as the paper does."));
    let elements = elements();
    for Element { pair: (a, b), text, printed } in &elements {
        let of_printed = pair_from_one(*printed).map_or("none".to_owned(), |(a, b)| format!("({a}, {b})"));
        sheet.row(json!([a, b, text, printed, index_of(a - 1, b - 1, OBJECTS), of_printed]));
    }
    Ok(sheet.about(about_elements(&elements)).about(about_all(device)?))
}

/// Which printed elements are ours.
fn about_elements(elements: &[Element]) -> String {
    let (right, wrong): (Vec<&Element>, Vec<&Element>) =
        elements.iter().partition(|element| pair_from_one(element.printed) == Some(element.pair));
    let wrong: Vec<String> =
        wrong.iter().map(|element| format!("{} at {:?}", element.text, element.pair)).collect();
    let wrong = if wrong.is_empty() { "none".to_owned() } else { wrong.join(", ") };
    format!("{} of the {} elements are ours; not: {wrong}.", right.len(), elements.len())
}

/// All pairs to and fro on the CPU, and on a device where there is one.
fn about_all(device: &Device) -> Result<String, Failure> {
    let all = pair_count(OBJECTS);
    let there = |k: u64| index_of(pair_of(k, OBJECTS).0, pair_of(k, OBJECTS).1, OBJECTS) == k;
    if let Some(k) = (0..all).find(|&k| !there(k)) {
        return Err(Failure::Check(format!("index {k} of {OBJECTS} boxes: {:?}", pair_of(k, OBJECTS))));
    }
    let cpu = format!("From each of the {} indices to the pair and back: right on the CPU", thousands(all));
    if device.adapter().is_none() {
        return Ok(format!("{cpu}."));
    }
    match (0..).zip(on_device()?).find(|&(k, pair)| pair != pair_of(k, OBJECTS)) {
        Some((k, pair)) => {
            Err(Failure::Check(format!("index {k} of {OBJECTS} boxes: the kernel gives {pair:?}")))
        }
        None => Ok(format!("{cpu}; the kernel `index_pairs` gives the same pairs.")),
    }
}

/// The pair of every index, by the mapping of the check kernels.
fn on_device() -> Result<Vec<(u64, u64)>, Failure> {
    let count = pair_count(OBJECTS) as u32;
    let params = Params { boxes: OBJECTS as u32, cells: count, ..Params::default() };
    let bindings = [bytemuck::bytes_of(&params).to_vec(), vec![0; 12 * count as usize]];
    let kernel = &pbig_harness::study::INDEX_PAIRS;
    let run = |bench: Bench| bench.run(kernel, &GpuOptions::DEFAULT, false, &bindings, count.div_ceil(LANES));
    let found =
        Bench::new().and_then(run).map_err(|error| Failure::Input(format!("{}: {error}", kernel.name)))?;
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&found[1]);
    Ok(words.chunks_exact(3).map(|words| (words[1].into(), words[2].into())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_elements_are_ours_but_the_last_of_the_matrix() {
        let text = about_elements(&elements());
        assert!(text.starts_with("11 of the 12 elements are ours"), "{text}");
        assert!(text.ends_with("not: (n^2 - n) / 2 at (999, 1000)."), "{text}");
    }

    #[test]
    fn elements_that_are_off_by_one_are_named() {
        let element = |printed| Element { pair: (1, 2), text: format!("number {printed}"), printed };
        assert_eq!(about_elements(&[element(0)]), "1 of the 1 elements are ours; not: none.");
        assert!(about_elements(&[element(1)]).ends_with("not: number 1 at (1, 2)."));
    }

    #[test]
    fn every_pair_is_right_wherever_it_is_computed() {
        let text = about_all(&Device::best(true)).expect("right pairs");
        assert!(text.starts_with("From each of the 499,500 indices"), "{text}");
    }
}
