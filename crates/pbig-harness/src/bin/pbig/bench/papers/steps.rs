//! Avril's table 6 and figures 5 and 6: steps with everything and with a part in motion.

use super::coverage::joined;
use super::device::Device;
use super::printed::AVRIL_6;
use super::sheet::{Sheet, short};
use super::{Scale, chart};
use crate::bench::gpu::events::race;
use crate::bench::measure::Effort;
use crate::bench::stages::{Alone, Measured, NAMES};
use crate::output::Failure;
use pbig_harness::boxes::cubes;
use pbig_harness::chart::Line;
use serde_json::{Value, json};

/// The distance that cubes with edges of 1 move in a step, along each axis.
pub(super) const DISTANCE: f32 = 0.1;

/// Explains `plan`, `map` and the last column of ours.
const WORK: &str = "Ours are means; the last column counts the updates of each algorithm. With `grid` plan and map rebuild \
                    the grid; with `edit` map moves the changed boxes to other cells of the grid.";

/// Table 6 and figure 5: a step in which all move.
pub(super) fn steps(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let columns = [
        "objects",
        "pairs",
        "side",
        "boxes up to date, ms",
        "grid (ours: plan and map), ms",
        "search (ours: check, emit, diff), ms",
        "whole, ms",
        "updates",
    ];
    let mut sheet = Sheet::new("Avril table 6 and figure 5: a step, all moving", &columns)
        .about(
            "Printed: a column of equal objects falls onto a plane, their GPU, transfers included. Ours: cubes with a \
             pair each, all moved by up to a tenth of their edge: `BroadPhase::set_many` of all, then `update`, events \
             included. Whole falling scenes with rapier: [step](step.md); the dynamic tree of figure \
             5 in today's form: [peers](peers.md).",
        )
        .about(WORK)
        .about(about_device(device));
    let mut lines = ["printed", "ours, CPU, means"].map(|name| Line { name: name.into(), points: vec![] });
    for (n, printed) in AVRIL_6 {
        if scale.quick && n > 100_000 {
            continue;
        }
        let ours = Alone::events(cubes(n, 1.0, 1.0, 1), 1.0, DISTANCE)?.measure(Effort::new(scale.quick))?;
        sheet.row(json!([n, null, "printed", printed[0], printed[1], printed[2], printed[3], null]));
        sheet.row(row(n, &ours));
        if let Some(gpu) = device.for_boxes(n) {
            let row = race(gpu, cubes(n, 1.0, 1.0, 1), 1.0, DISTANCE)?;
            sheet.row(json!([n, row.pairs, "ours, GPU", null, null, null, row.gpu.median, null]));
        }
        lines
            .iter_mut()
            .zip([printed[3], ours.mean[0]])
            .for_each(|(line, ms)| line.points.push((n as f64, ms)));
    }
    Ok(sheet.chart(chart("steps", "Avril table 6 and figure 5: a step, all moving", "objects", lines)))
}

/// Explains the times of a device: medians, with the events of each call compared.
fn about_device(device: &Device) -> String {
    format!("On a device the median of a few updates, the same events as the CPU in each. {}", device.about())
}

fn row(n: usize, ours: &Measured) -> Value {
    let of = |wanted: &[&str]| {
        NAMES.iter().zip(ours.mean).filter(|(name, _)| wanted.contains(name)).map(|(_, ms)| ms).sum::<f64>()
    };
    let (map, search) = (of(&["plan", "map"]), of(&["check", "emit", "diff"]));
    json!([n, ours.pairs, "ours, CPU", of(&["set"]), map, search, ours.mean[0], ours.chosen])
}

/// A share of moved boxes, and the means of both sides in ms.
struct Moved {
    share: f64,
    events: f64,
    scratch: f64,
}

/// Figure 6: a step in which a share moves.
pub(super) fn movers(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let n = if scale.quick { 10_000 } else { 100_000 };
    let columns = [
        "share moved",
        "boxes",
        "pairs",
        "ms, events",
        "ms, from nothing",
        "updates",
        "boxes, GPU",
        "ms, events, GPU",
        "ms, events, CPU with as many",
    ];
    let mut sheet = Sheet::new("Avril figure 6: share of moving objects", &columns).about(
        "The figure has no printed numbers; the text says that the time stays the same whatever moves, as everything \
         is searched from nothing.",
    );
    let mut rows = Vec::new();
    for share in [0.01, 0.1, 0.25, 0.5, 0.75, 1.0] {
        let (boxes, effort) = (|| cubes(n, 1.0, 1.0, 1), Effort::new(scale.quick));
        let events = Alone::events(boxes(), share, DISTANCE)?.measure(effort)?;
        let scratch = Alone::scratch(boxes(), share, DISTANCE).measure(effort)?;
        let row = Moved { share, events: events.mean[0], scratch: scratch.mean[0] };
        let ours = json!([share, n, events.pairs, row.events, row.scratch, events.chosen]);
        sheet.row(joined(ours, beside(device, n, share)?));
        rows.push(row);
    }
    let line = |name: &str, of: fn(&Moved) -> f64| Line {
        name: name.into(),
        points: rows.iter().map(|row| (row.share, of(row))).collect(),
    };
    let lines = [line("events", |row| row.events), line("from nothing", |row| row.scratch)];
    let sheet = sheet.about(about_movers(&rows)).about(WORK).about(about_device(device));
    Ok(sheet.chart(chart("movers", "Avril figure 6: share of moving objects", "share moved", lines)))
}

/// Boxes on a device, and milliseconds there and on the CPU; a program that plays one has fewer boxes.
fn beside(device: &Device, n: usize, share: f64) -> Result<Value, Failure> {
    let n = if device.for_boxes(n).is_some() { n } else { n.min(10_000) };
    let Some(gpu) = device.for_boxes(n) else { return Ok(json!([null, null, null])) };
    let row = race(gpu, cubes(n, 1.0, 1.0, 1), share, DISTANCE)?;
    Ok(json!([n, row.gpu.median, row.cpu.median]))
}

/// Compares the two sides of the rows.
fn about_movers(rows: &[Moved]) -> String {
    let at = |holds: &dyn Fn(&Moved) -> bool| {
        let shares: Vec<String> = rows.iter().filter(|row| holds(row)).map(percent).collect();
        if shares.is_empty() { "no share".to_owned() } else { shares.join(", ") }
    };
    let (least, most) = rows
        .iter()
        .fold((f64::MAX, 0.0f64), |(least, most), row| (least.min(row.scratch), most.max(row.scratch)));
    format!(
        "Our `Finder`, from nothing, takes {} to {} ms, at most {} times the least. The events of `BroadPhase` take \
         less than that run of it at {}, and more at {}; as more move, their time {}.",
        short(least),
        short(most),
        short(most / least),
        at(&|row| row.events < row.scratch),
        at(&|row| row.events >= row.scratch),
        about_turns(rows)
    )
}

/// Between which shares the time of events rises, and between which it falls.
fn about_turns(rows: &[Moved]) -> String {
    let stretches = |verb: &str, holds: fn(f64, f64) -> bool| {
        let named: Vec<String> = rows
            .windows(2)
            .filter(|two| holds(two[0].events, two[1].events))
            .map(|two| format!("{} to {}", percent(&two[0]), percent(&two[1])))
            .collect();
        (!named.is_empty()).then(|| format!("{verb} from {}", named.join(", from ")))
    };
    let both = [stretches("rises", |from, to| to > from), stretches("falls", |from, to| to < from)];
    let both: Vec<String> = both.into_iter().flatten().collect();
    if both.is_empty() { "stays the same".to_owned() } else { both.join(" and ") }
}

fn percent(row: &Moved) -> String {
    format!("{}%", 100.0 * row.share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_movers_is_what_the_rows_show() {
        let rows = |events: [f64; 3]| {
            [0.01, 0.25, 1.0].into_iter().zip(events).map(|(share, events)| Moved {
                share,
                events,
                scratch: 5.0,
            })
        };
        let text = about_movers(&rows([1.0, 9.0, 4.0]).collect::<Vec<_>>());
        assert!(text.contains("less than that run of it at 1%, 100%, and more at 25%"), "{text}");
        assert!(text.ends_with("their time rises from 1% to 25% and falls from 25% to 100%."), "{text}");
        let text = about_movers(&rows([4.0, 3.0, 2.0]).collect::<Vec<_>>());
        assert!(text.ends_with("their time falls from 1% to 25%, from 25% to 100%."), "{text}");
        let text = about_movers(&rows([1.0, 2.0, 4.0]).collect::<Vec<_>>());
        assert!(
            text.contains("more at no share")
                && text.ends_with("time rises from 1% to 25%, from 25% to 100%."),
            "{text}"
        );
    }
}
