//! PBIG's figures 8 and 11: number of boxes, distribution.

use super::device::{Device, on_gpu};
use super::model::{Edges, Model, Place, Space};
use super::printed::{
    GAUSSIAN_GB, GAUSSIAN_PAIRS, LENGTHS, MOST_SPEED_UPS, NORMAL, OVER_CGAL_GAUSSIAN, OVER_PRI, SPACE,
    SPEED_UPS, TABLE_VI,
};
use super::sheet::{Sheet, short, thousands};
use super::{Scale, UNSORTED, chart, effort};
use crate::bench::finders::{Finders, Way};
use crate::bench::measure::timed;
use crate::output::Failure;
use pbig_core::{Aabb, Finder, GpuOptions};
use pbig_harness::boxes::moved;
use pbig_harness::chart::Line;
use pbig_harness::study::SETTINGS;
use serde_json::{Value, json};

/// Section 6.1 as it is printed.
pub(super) const UNIFORM: Model =
    Model { space: Space::Even(SPACE), place: Place::Centre, edges: Edges::boxes(LENGTHS[0], LENGTHS[1]) };

/// Section 6.3 as it is printed.
const GAUSSIAN: Model = Model { space: Space::Normal(NORMAL), ..UNIFORM };

/// Section 6.3 by the reading that gives table III: lower corners, lengths from 0.
const GAUSSIAN_READ: Model =
    Model { place: Place::LowerCorner, edges: Edges::boxes(0.0, LENGTHS[1]), ..GAUSSIAN };

/// Most pairs of a call here: their list and its copy stay below 4 GB.
const MOST_PAIRS: f64 = 2e8;
/// Most boxes for PBIG's grid on one thread.
const MOST_PLAIN: usize = 1_000_000;

const SIDES: [&str; 3] = ["our grid, CPU", "PBIG's grid, CPU, one thread", "GPU"];

/// Milliseconds of each side that takes part, and the pairs.
fn sides(model: &Model, n: usize, device: &Device) -> Result<([Option<f64>; 3], u64), Failure> {
    let boxes = model.boxes(n, 1);
    if model.pairs(n) > MOST_PAIRS {
        let (pairs, ms) = in_slabs(&boxes, (model.pairs(n) / 2e7).ceil() as usize)?;
        return Ok(([Some(ms), None, None], pairs));
    }
    let gpu = device.for_boxes(n);
    let mut takes_part: Vec<(usize, Way)> = vec![(0, UNSORTED.into())];
    if n <= MOST_PLAIN {
        takes_part.push((1, SETTINGS.into()));
    }
    if gpu.is_some() {
        takes_part.push((2, on_gpu(GpuOptions::DEFAULT).into()));
    }
    let ways = takes_part.iter().map(|(_, way)| *way);
    let mut finders = Finders::new(ways, gpu, [moved(&boxes, 1.0, 2), boxes]);
    let mut times = [None; 3];
    for ((side, _), ms) in takes_part.iter().zip(finders.times(effort(n))?) {
        times[*side] = Some(ms);
    }
    Ok((times, finders.pairs()?))
}

/// Pairs that are too many for one list, counted slab by slab: each slab searches the boxes that reach into
/// it and counts pairs whose higher lower corner is its own. And the milliseconds of the searches.
fn in_slabs(boxes: &[Aabb], slabs: usize) -> Result<(u64, f64), Failure> {
    let mut corners: Vec<f32> = boxes.iter().map(|b| b.min[0]).collect();
    corners.sort_unstable_by(f32::total_cmp);
    let border = |slab: usize| corners.get(slab * corners.len() / slabs).copied().unwrap_or(f32::INFINITY);
    let mut finder = Finder::new(UNSORTED);
    let (mut pairs, mut ms) = (0, 0.0);
    for slab in 0..slabs {
        let (low, high) = (border(slab), border(slab + 1));
        let inside: Vec<Aabb> =
            boxes.iter().filter(|b| b.min[0] < high && b.max[0] >= low).copied().collect();
        let (found, time) = timed(|| finder.find(&inside));
        let found = found.map_err(|error| Failure::Input(error.to_string()))?;
        let corner = |id: u32| inside[id as usize].min[0];
        pairs += found.iter().filter(|pair| corner(pair.a).max(corner(pair.b)) >= low).count() as u64;
        ms += time;
    }
    Ok((pairs, ms))
}

/// Rows by number of boxes, with the chart of their times.
fn by_number(
    mut sheet: Sheet,
    name: &str,
    title: &str,
    model: &Model,
    scale: &Scale,
    device: &Device,
    printed: impl Fn(usize) -> Value,
) -> Result<Sheet, Failure> {
    let mut lines = SIDES.map(|name| Line { name: name.into(), points: vec![] });
    for &n in scale.numbers {
        let (times, pairs) = sides(model, n, device)?;
        for (line, ms) in lines.iter_mut().zip(times) {
            line.points.extend(ms.map(|ms| (n as f64, ms)));
        }
        let [ours, plain, gpu] = times;
        sheet.row(json!([
            n,
            model.pairs(n).round() as u64,
            pairs,
            model.off(n, pairs),
            printed(n),
            ours,
            plain,
            gpu
        ]));
    }
    if device.is_software() || device.adapter().is_none() {
        lines[2].points.clear();
    }
    let drawn: Vec<Line> = lines.into_iter().filter(|line| !line.points.is_empty()).collect();
    Ok(sheet.chart(chart(name, title, "boxes", drawn)))
}

fn columns(device: &Device) -> [&'static str; 8] {
    let off = "off, standard deviations";
    [
        "boxes",
        "pairs expected",
        "pairs",
        off,
        "ms printed",
        "ms, our grid, CPU",
        "ms, PBIG's grid, CPU, one thread",
        device.column(),
    ]
}

pub(super) fn uniform(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let sheet = Sheet::new("PBIG figure 8: number of boxes", &columns(device)).about(
        "Section 6.1 as printed: centres uniform in a space of 10^4, lengths uniform from 1 to 100. Whole calls from \
         nothing, all boxes moved since the call before. The figure has no printed numbers; at 10^7 boxes the text \
         has less than a second (6.2).",
    );
    let sheet = sheet.about(format!(
        "The paper says up to {} times CGAL's speed, {} times BULLET's and {} times PRI's in sections 1 and 7; and at 10^7 \
         boxes, in section 6.1, {} times CGAL's and {} times PRI's, and that BULLET had not the memory for as many. They are not run here: no times of theirs are printed, only curves, and the \
         quotients are of its Tesla C2070 and the processor beside it. Trees of today beside ours: [peers](peers.md).",
        SPEED_UPS[0],
        MOST_SPEED_UPS[0],
        MOST_SPEED_UPS[1],
        SPEED_UPS[1],
        OVER_PRI
    ));
    let printed = |n| if n == super::printed::MOST_BOXES { json!("< 1000") } else { Value::Null };
    by_number(sheet, "uniform", "PBIG figure 8: number of boxes", &UNIFORM, scale, device, printed)
}

pub(super) fn gaussian(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let most = super::printed::MOST_BOXES;
    let bytes = GAUSSIAN_GB[0] * 1e9;
    let sheet = Sheet::new("PBIG figure 11: distribution of boxes", &columns(device))
        .about(format!(
            "Section 6.3 as printed: centres normal with deviation 1000, lengths uniform from 1 to 100. More than {} \
             expected pairs are counted slab by slab along x, which searches boxes at borders twice; the time is the \
             sum.",
            short(MOST_PAIRS)
        ))
        .about(format!(
            "At 10^7 boxes the paper has \"approximately\" {} pairs, and {} GB uncompressed, which at 8 bytes a pair \
             is {} pairs. As printed the boxes would have {}; with lower corners normal and lengths from 0, the \
             reading that gives table III, {}: {} % off the bytes, against {} %.",
            thousands(GAUSSIAN_PAIRS),
            GAUSSIAN_GB[0],
            short(bytes / 8.0),
            short(GAUSSIAN.pairs(most)),
            short(GAUSSIAN_READ.pairs(most)),
            short(100.0 * (8.0 * GAUSSIAN_READ.pairs(most) / bytes - 1.0)),
            short(100.0 * (8.0 * GAUSSIAN.pairs(most) / bytes - 1.0)),
        ))
        .about(format!(
            "Over CGAL at 10^7 boxes the paper says {} times here, against {} where centres are uniform (6.3).",
            OVER_CGAL_GAUSSIAN, SPEED_UPS[1]
        ));
    let printed = |n| if n == most { json!(TABLE_VI[7].total as f64 / 1e3) } else { Value::Null };
    by_number(
        sheet,
        "gaussian",
        "PBIG figure 11: number of boxes, normal centres",
        &GAUSSIAN,
        scale,
        device,
        printed,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn slabs_count_each_pair_once() {
        for model in [UNIFORM, GAUSSIAN, GAUSSIAN_READ] {
            let model = Model { edges: Edges::boxes(0.0, 900.0), ..model };
            let boxes = model.boxes(3000, 5);
            let pairs = oracle::pairs(&boxes).len() as u64;
            for slabs in [1, 2, 7, 50] {
                assert_eq!(in_slabs(&boxes, slabs).expect("found").0, pairs, "{slabs} slabs");
            }
        }
    }

    #[test]
    fn the_printed_size_of_the_output_fits_lengths_from_0_and_not_from_1() {
        let printed = GAUSSIAN_GB[0] * 1e9 / 8.0;
        let off = |model: &Model| model.pairs(super::super::printed::MOST_BOXES) / printed - 1.0;
        assert!(off(&GAUSSIAN_READ).abs() < 1e-3 && off(&GAUSSIAN) > 0.02);
    }

    #[test]
    fn every_side_finds_the_pairs_of_brute_force() {
        let (times, pairs) = sides(&GAUSSIAN, 1000, &Device::best(true)).expect("agreed");
        assert_eq!(pairs, oracle::pairs(&GAUSSIAN.boxes(1000, 1)).len() as u64);
        assert!(times[0].is_some() && times[1].is_some());
    }
}
