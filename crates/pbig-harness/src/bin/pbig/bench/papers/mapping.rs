//! Avril's table 2 and the times of table 4 on a device: from the index of a pair to the pair, with a root and without.

use super::device::{Device, kernels, on_gpu, same_pairs};
use super::printed::{AVRIL_2, AVRIL_4};
use super::sheet::{Sheet, short};
use super::{UNSORTED, once};
use crate::output::Failure;
use pbig_core::GpuOptions;
use pbig_harness::boxes::cubes;
use pbig_harness::study::{PbigSettings, SETTINGS, with_gpu_grid};
use serde_json::json;

/// The values of `GpuOptions::root`, in words.
const ROOTS: [(u32, &str); 8] = [
    (0, "the device's square root"),
    (2, "Carmack, 2 steps"),
    (3, "Carmack, 3 steps"),
    (4, "Carmack, 4 steps"),
    (6, "Lomont, 2 steps"),
    (7, "Lomont, 3 steps"),
    (8, "Lomont, 4 steps"),
    (9, "no root: bisection"),
];

/// The same on a device, with the roots of table 4.
pub(super) fn roots(device: &Device) -> Result<Sheet, Failure> {
    const OBJECTS: usize = 1000;
    let columns = ["root", "ms of the kernel `check_all`", "times as long as the first", "pairs"];
    let mut sheet = Sheet::new("Avril tables 2 and 4: roots, GPU", &columns)
        .about(format!(
            "{OBJECTS} objects, every pair tested by `check_all`. Printed for 1000: {} ms with the root and {} \
             without; table 4 has {} of CUDA's roots in {} ms, and by its times {} less with Carmack's or Lomont's. \
             Here integers correct each, so all are exact. {}",
            AVRIL_2[0].1,
            AVRIL_2[0].2,
            short(AVRIL_4[3].roots as f64),
            AVRIL_4[3].cuda,
            less(),
            device.about()
        ))
        .about(
            "How exact each is without the integers, the paper's table 3 beside ours, and the roots of table 4 alone on one \
             thread: [accuracy](accuracy.md).",
        );
    let configs = ROOTS.map(|(root, _)| on_gpu(GpuOptions { root, ..GpuOptions::DEFAULT }));
    let boxes = cubes(OBJECTS, 1.0, 1.0, 1);
    let runs = device.run(&configs, &boxes, 0.1)?;
    same_pairs(&runs, once(UNSORTED, &boxes)?.pairs)?;
    let times: Vec<Option<f64>> =
        runs.iter().map(|(_, report)| kernels(report, |name| name == "check_all")).collect();
    for ((_, name), (ms, (_, report))) in ROOTS.iter().zip(times.iter().zip(&runs)) {
        let ratio = times[0].zip(*ms).map(|(first, ms)| ms / first);
        sheet.row(json!([name, ms, ratio, report.pairs]));
    }
    let spread = longest_over_shortest(times.iter().copied().flatten());
    let says = |spread| {
        format!(
            "The kernel, which tests boxes too, takes at most {} times as long with one as with another.",
            short(spread)
        )
    };
    Ok(match spread {
        Some(spread) => sheet.about(says(spread)),
        None => sheet,
    })
}

/// By how much table 4's times with approximations are below those without.
fn less() -> String {
    let less = AVRIL_4.iter().map(|row| row.reduction(0.0));
    let (least, most) = less.fold((f64::MAX, 0.0f64), |(least, most), x| (least.min(x), most.max(x)));
    format!("{least:.1} to {most:.1} %")
}

/// Objects of table 2 that a device searches in the cells of a grid only.
const IN_CELLS: [usize; 2] = [10_000, 100_000];

/// Table 2 beyond brute force: with a root and without in the cells of a grid, as table 2's times seem to be.
pub(super) fn in_cells(device: &Device) -> Result<Sheet, Failure> {
    let columns = ["objects", "root", "ms of the kernel `check_small`", "checks", "pairs"];
    let mut sheet = Sheet::new("Avril table 2: roots in the cells of a grid, GPU", &columns).about(format!(
        "More than 1024 boxes a device does not search by brute force, but in cells, where `check_small` maps the \
         indices of a cell's pairs; all cells of up to 256 boxes. Cubes with a pair each, as many pairs as on the CPU. {}",
        device.about()
    ));
    for n in IN_CELLS {
        if device.for_boxes(n).is_none() {
            continue;
        }
        let boxes = cubes(n, 1.0, 1.0, 1);
        let pairs = once(UNSORTED, &boxes)?.pairs;
        for (root, name) in ROOTS {
            let gpu = on_gpu(GpuOptions { root, ..GpuOptions::DEFAULT });
            let config = with_gpu_grid(gpu, &PbigSettings { small_cell: 256, ..SETTINGS }, 0);
            if let Some((_, report)) = device.run_for(config, &boxes, 0.1, pairs)? {
                let kernel = kernels(&report, |name| name == "check_small");
                sheet.row(json!([n, name, kernel, report.checks.made, report.pairs]));
            }
        }
    }
    Ok(sheet)
}

fn longest_over_shortest(times: impl Iterator<Item = f64>) -> Option<f64> {
    let (least, most) = times.fold((f64::MAX, 0.0f64), |(least, most), ms| (least.min(ms), most.max(ms)));
    (least > 0.0 && most > 0.0).then(|| most / least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_spread_by_the_longest_over_the_shortest() {
        assert_eq!(longest_over_shortest([2.0, 3.0, 1.5].into_iter()), Some(2.0));
        assert_eq!(longest_over_shortest([].into_iter()), None);
    }

    #[test]
    fn what_roots_save_is_by_the_printed_times() {
        assert_eq!(less(), "12.5 to 14.6 %");
    }
}
