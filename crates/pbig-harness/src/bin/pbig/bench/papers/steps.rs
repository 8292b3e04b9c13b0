//! Avril's table 6 and figures 5 and 6: steps with everything and with a part in motion.

use super::printed::AVRIL_6;
use super::sheet::{Sheet, short};
use super::{Scale, chart};
use crate::bench::measure::Effort;
use crate::bench::stages::{Alone, Measured, NAMES};
use crate::output::Failure;
use pbig_harness::boxes::cubes;
use pbig_harness::chart::Line;
use serde_json::{Value, json};

/// How far cubes with edges of 1 move in a step, along each axis.
pub(super) const DISTANCE: f32 = 0.1;

/// What `plan` and `map` are, and what the last column of ours says.
const WORK: &str = "Ours are means, so that updates which make a list or a grid for others count; the last column has \
                    how many updates did what. By a list of near pairs (`near`) nothing is sorted: plan is a look at \
                    which boxes have left the reach that the list was made for, map puts those elsewhere. With `grid` \
                    plan and map make the grid anew, with `edit` map puts what has moved into other cells of it.";

/// Table 6 and figure 5: a step in which all move.
pub(super) fn steps(scale: &Scale) -> Result<Sheet, Failure> {
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
             pair each, all moved by up to a tenth of their edge, on the CPU: `BroadPhase::set_many` of all, then \
             `update`, events included. Whole falling scenes with rapier: [step](step.md); the dynamic tree of figure \
             5 in today's form: [peers](peers.md).",
        )
        .about(WORK);
    let mut lines = ["printed", "ours, CPU, means"].map(|name| Line { name: name.into(), points: vec![] });
    for (n, printed) in AVRIL_6 {
        if scale.quick && n > 100_000 {
            continue;
        }
        let ours = Alone::events(cubes(n, 1.0, 1.0, 1), 1.0, DISTANCE)?.measure(Effort::new(scale.quick))?;
        sheet.row(json!([n, null, "printed", printed[0], printed[1], printed[2], printed[3], null]));
        sheet.row(row(n, &ours));
        lines
            .iter_mut()
            .zip([printed[3], ours.mean[0]])
            .for_each(|(line, ms)| line.points.push((n as f64, ms)));
    }
    Ok(sheet.chart(chart("steps", "Avril table 6 and figure 5: a step, all moving", "objects", lines)))
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
pub(super) fn movers(scale: &Scale) -> Result<Sheet, Failure> {
    let n = if scale.quick { 10_000 } else { 100_000 };
    let columns = ["share moved", "boxes", "pairs", "ms, events", "ms, from nothing", "updates"];
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
        sheet.row(json!([share, n, events.pairs, row.events, row.scratch, events.chosen]));
        rows.push(row);
    }
    let line = |name: &str, of: fn(&Moved) -> f64| Line {
        name: name.into(),
        points: rows.iter().map(|row| (row.share, of(row))).collect(),
    };
    let lines = [line("events", |row| row.events), line("from nothing", |row| row.scratch)];
    let sheet = sheet.about(about_movers(&rows)).about(WORK);
    Ok(sheet.chart(chart("movers", "Avril figure 6: share of moving objects", "share moved", lines)))
}

/// What the rows say about both sides, and no more.
fn about_movers(rows: &[Moved]) -> String {
    let percent = |row: &Moved| format!("{}%", 100.0 * row.share);
    let at = |holds: &dyn Fn(&Moved) -> bool| {
        let shares: Vec<String> = rows.iter().filter(|row| holds(row)).map(percent).collect();
        if shares.is_empty() { "no share".to_owned() } else { shares.join(", ") }
    };
    let fall = |two: &[Moved]| {
        (two[1].events < two[0].events).then(|| format!("{} to {}", percent(&two[0]), percent(&two[1])))
    };
    let falls: Vec<String> = rows.windows(2).filter_map(fall).collect();
    let falls =
        if falls.is_empty() { String::new() } else { format!(", but falls from {}", falls.join(", from ")) };
    let (least, most) = rows
        .iter()
        .fold((f64::MAX, 0.0f64), |(least, most), row| (least.min(row.scratch), most.max(row.scratch)));
    format!(
        "Our `Finder`, from nothing, takes {} to {} ms. The events of `BroadPhase` take less than that run of it at \
         {}, and more at {}; their time rises with the share that moves{falls}.",
        short(least),
        short(most),
        at(&|row| row.events < row.scratch),
        at(&|row| row.events >= row.scratch)
    )
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
        assert!(text.ends_with("moves, but falls from 25% to 100%."), "{text}");
        let text = about_movers(&rows([1.0, 2.0, 4.0]).collect::<Vec<_>>());
        assert!(text.contains("more at no share") && text.ends_with("with the share that moves."), "{text}");
    }
}
