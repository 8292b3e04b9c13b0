//! `pbig bench steady`: whether updates take equally long, frame by frame: nine motions of boxes, and every scene through rapier.

mod case;
mod frames;
mod scenes;

use super::machine::{Machine, slug};
use super::{Args, Outcome, save, show};
use crate::output::{Failure, print};
use case::{Case, HEAD, Side};
use pbig_harness::chart::{self, Panel, Series};
use pbig_harness::motions::{Density, Motion};
use std::path::Path;

/// Motions whose times are drawn frame by frame, dense.
const DRAWN: [Motion; 4] = [Motion::Drift, Motion::Fall, Motion::Burst, Motion::Shares];

/// Most boxes of a drawn case.
const MOST_DRAWN: usize = 100_000;

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let sizes = |full: &[usize], quick: &[usize]| match &args.boxes[..] {
        [] => if args.quick { quick } else { full }.to_vec(),
        given => given.to_vec(),
    };
    let boxes = sizes(&[1000, 10_000, 100_000, 1_000_000], &[1000, 10_000]);
    let bodies = sizes(&[10, 100, 1000, 10_000, 100_000], &[10, 100]);
    let mut cases = frames::run(&boxes, args.quick)?;
    cases.extend(scenes::run(&bodies, args.quick));
    let rows = cases.iter().flat_map(|case| case.rows(args.quick)).collect();
    let mut outcome = Outcome { rows, notes: notes(), charts: vec![] };
    show("steady", &mut outcome, &Machine::here(), args.json)?;
    args.write.as_ref().map_or(Ok(()), |folder| write(folder, &cases, args.json))
}

fn notes() -> Vec<String> {
    [
        "ours and the other are means; median, p99 and worst are beside; none of them counts the first frame",
        "boxes: ours is `set_many` of the changed boxes and `update` with sorted events. Beside it, in each frame and \
         on the same boxes, `Finder` with `Order::Unspecified` searches from nothing, and parry 0.31 updates, \
         improves and refits its tree and traverses all of it; parry has no events",
        "the finder and parry search in every frame, also where nothing has changed; pairs agreed in number in every frame",
        "scenes: all calls of a step through rapier, beside stock in the same world, which gets our events",
    ]
    .map(str::to_owned)
    .into()
}

/// Writes the CSV and the chart.
fn write(folder: &Path, cases: &[Case], quiet: bool) -> Result<(), Failure> {
    let lines: Vec<String> = cases.iter().flat_map(Case::lines).collect();
    let csv = folder.join(format!("steady-{}.csv", slug(&Machine::here().cpu)));
    save(&csv, &format!("{HEAD}\n{}\n", lines.join("\n")))?;
    let svg = folder.join("steady-frames.svg");
    draw(&svg, cases)?;
    if quiet { Ok(()) } else { print(&format!("written to {} and {}", csv.display(), svg.display())) }
}

/// Draws one panel for each of the drawn cases, of the largest of its sizes.
fn draw(path: &Path, cases: &[Case]) -> Result<(), Failure> {
    let drawn: Vec<&Case> = DRAWN.iter().filter_map(|motion| largest(cases, *motion)).collect();
    let titles: Vec<String> =
        drawn.iter().map(|case| format!("{}: {} boxes", case.name(), case.boxes)).collect();
    // The first frame is longer than all others and would flatten their lines.
    let series = |side: &'_ Side| Series { name: side.label(), values: side.ms[1..].to_vec() };
    let panel = |(case, title): (&&Case, _)| Panel { title, series: case.sides.iter().map(series).collect() };
    let panels: Vec<Panel<'_>> = drawn.iter().zip(titles.iter().map(String::as_str)).map(panel).collect();
    if panels.is_empty() { Ok(()) } else { Ok(chart::write(path, &panels)?) }
}

/// Returns the dense case of a motion with most boxes among those that may be drawn.
fn largest(cases: &[Case], motion: Motion) -> Option<&Case> {
    let is_drawn = |case: &&Case| {
        let of = (case.motion, case.density) == (motion.name(), Density::Dense.name());
        of && case.boxes <= MOST_DRAWN
    };
    cases.iter().filter(is_drawn).max_by_key(|case| case.boxes)
}
