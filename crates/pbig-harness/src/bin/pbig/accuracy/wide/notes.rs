//! The findings of the rows, in words.

use super::OFFSETS;
use super::place::{AT_POSES, Along, IN_WORLD, Row, WAYS, Way};
use super::times::{Time, ways};
use crate::accuracy::study::plain;
use rapier_pbig::PbigConfig;

/// The first crowd, of any size, along the diagonal.
pub(super) fn is_crowd(row: &Row) -> bool {
    row.world.starts_with("crowd") && row.along == Along::Diagonal
}

/// Returns the distance from the origin up to which the margin covers the loss by rounding, its own included: 2 ulps, which
/// are 2^-22 of the distance at most.
pub(super) fn covered() -> f64 {
    f64::from(PbigConfig::DEFAULT.margin) * 2f64.powi(22)
}

/// A bound of rapier's ends too far inside by no more of its ulps, at the poses: proof in `pbig_harness::wide::ulps`.
const PROVED: f64 = 2.0;

/// Over all worlds at an offset.
pub(super) fn sum(rows: &[Row], offset: f64, of: &dyn Fn(&Row) -> u64) -> u64 {
    rows.iter().filter(|row| row.offset == offset).map(of).sum()
}

pub(super) fn notes(rows: &[Row], timed: &[(f64, Vec<Time>)]) -> Vec<String> {
    let mut notes = vec![
        "The truth is boxes of parry3d-f64, from which rapier3d-f64 has its own, around the same shapes in the \
         same layouts, moved away from the origin in f64 and grown by half the prediction distance as rapier's \
         are; and, in a table of their own, in each step of simulations by rapier3d-f64, around its colliders. So \
         every difference in the other tables is one of rounding. What becomes of a simulation in f32 is told in that \
         one, as two simulations part within steps, whatever differs between them, and then their pairs are of two \
         worlds."
            .to_owned(),
        "*By poses*: these boxes at the poses that rapier holds in f32, against those at poses in f64; that is \
         another world, and no broad phase can tell. *By boxes*: boxes in f32, as rapier computes them, against \
         boxes in f64 at the same poses. *Of touching shapes*: the boxes of the shapes themselves overlap, not \
         just those grown by the prediction distance. Boxes that touch as far as f64 can tell count neither as a \
         pair nor as none."
            .to_owned(),
    ];
    notes.extend([boxes_note(rows), kinds_note(rows), margin_note(rows), ulps_note(rows), world_note(rows)]);
    notes.extend([cost_note(rows, timed), ratio_note(timed)]);
    notes
}

/// "1e5: 3 of 1000" for each offset at which there is some.
fn counts(rows: &[Row], of: &dyn Fn(&Row) -> u64, all: &dyn Fn(&Row) -> u64) -> String {
    let some = OFFSETS.into_iter().map(|offset| (offset, sum(rows, offset, of), sum(rows, offset, all)));
    let told = some
        .filter(|(_, count, _)| *count > 0)
        .map(|(offset, count, all)| format!("{count} of {all} at {offset:e}"));
    let told: Vec<_> = told.collect();
    if told.is_empty() { "none".into() } else { told.join(", ") }
}

fn boxes_note(rows: &[Row]) -> String {
    let way = Way::Ulps(0);
    let missed = counts(rows, &|row| row.by_boxes(way).missed, &|row| row.held_pairs);
    let deep = counts(rows, &|row| row.by_boxes(way).missed_deep, &|row| row.held_pairs);
    format!("Rapier's boxes without a margin miss, at the poses: {missed}. Of touching shapes: {deep}.")
}

/// By world: which shapes they are.
fn kinds_note(rows: &[Row]) -> String {
    let mut worlds: Vec<&str> = rows.iter().map(|row| row.world).collect();
    worlds.dedup();
    let of = |world: &str| {
        let rows = rows.iter().filter(|row| row.world == world);
        let missed: u64 = rows.map(|row| row.by_boxes(Way::Ulps(0)).missed_deep).sum();
        format!("{world} {missed}")
    };
    format!(
        "Rounding is monotone: it parts no two numbers that are in order, however often both are rounded alike. \
         Missed pairs of touching shapes, by world: {}. Why: docs/ARCHITECTURE.md, far from the origin.",
        worlds.into_iter().map(of).collect::<Vec<_>>().join("; ")
    )
}

fn margin_note(rows: &[Row]) -> String {
    let way = Way::Margin(0);
    let missed = counts(rows, &|row| row.by_boxes(way).missed, &|row| row.held_pairs);
    let deep = counts(rows, &|row| row.by_boxes(way).missed_deep, &|row| row.held_pairs);
    format!(
        "With the margin that boxes are stored with, {}, they miss: {missed}; of touching shapes: {deep}. It \
         covers the rounding of boxes, and its own, while two ulps are no more than it: up to the margin times \
         2^22, {:.0} length units.",
        PbigConfig::DEFAULT.margin,
        covered()
    )
}

fn ulps_note(rows: &[Row]) -> String {
    let fewest = |missed: &dyn Fn(&Row, Way) -> u64| {
        let ulps = WAYS.into_iter().filter(|way| matches!(way, Way::Ulps(_)));
        let mut enough = ulps.filter(|&way| rows.iter().all(|row| missed(row, way) == 0));
        enough.next().map_or("none of the ways".into(), |way| way.name())
    };
    let shortfall = rows.iter().map(|row| row.shortfall).fold(0.0, f64::max);
    let verdict = if shortfall <= PROVED { "no more than" } else { "MORE THAN" };
    format!(
        "The fewest ulps without a missed pair in these worlds: at the poses {}, against the world in f64 {}. \
         Ulps by which boxes are widened, or end too far inside, are all of one kind: an ulp of position and \
         reach on that axis, and 2^-17 of the reach, as `widened_by_ulps` has them. (Sizes, and `ulp` in the \
         tables, are in distances from one f32 to the next at the offset.) A bound of rapier's was at most {} of \
         them too far inside at the poses, {verdict} the {PROVED} that are proved. Pairs are checked in every \
         run: none is missed {} at the poses, nor {} in the world.",
        fewest(&|row, way| row.by_boxes(way).missed),
        fewest(&|row, way| row.in_all(way).missed),
        plain(shortfall),
        AT_POSES.name(),
        IN_WORLD.name()
    )
}

/// Describes the places at which the world that rapier holds is another one.
fn world_note(rows: &[Row]) -> String {
    let wrong = |row: &Row| row.wrong_percent(Way::Ulps(0));
    let largest = |percent: f64| {
        let worse = rows.iter().filter(|row| is_crowd(row) && wrong(row) > percent);
        worse.map(Row::size_in_ulps).fold(0.0, f64::max)
    };
    let told = [10.0, 1.0, 0.1].map(|percent| format!("{percent}% up to {}", plain(largest(percent))));
    format!(
        "Where it starts to matter, by poses and boxes together, is a question of how many ulps shapes are large. \
         Of the crowd's pairs more are wrong than {}.",
        told.join(", ")
    )
}

/// Describes the cost of widening in the crowd.
fn cost_note(rows: &[Row], timed: &[(f64, Vec<Time>)]) -> String {
    let at = |way: Way| ways().position(|one| one == way).unwrap_or(0);
    let mean = |way: Way| {
        let times = timed.iter().map(|(_, times)| times[at(way)].boxes);
        times.sum::<f64>() / timed.len().max(1) as f64
    };
    let crowd = rows.iter().filter(|row| is_crowd(row) && row.size == 1.0);
    let added = |row: &Row, way: Way| row.in_all(way).added as f64 / row.pairs.max(1) as f64 * 100.0;
    let told = crowd.map(|row| {
        let [with, without] = [AT_POSES, Way::Ulps(0)].map(|way| plain(added(row, way)));
        format!("{with}% at {:e} (rapier's boxes {without}%)", row.offset)
    });
    format!(
        "To compute a box takes {:.0} ns, {} {:.0} ns (means over offsets). Pairs of the crowd, along the \
         diagonal, that are added so to those in f64: {}.",
        mean(Way::Ulps(0)),
        AT_POSES.name(),
        mean(AT_POSES),
        told.collect::<Vec<_>>().join(", ")
    )
}

fn ratio_note(timed: &[(f64, Vec<Time>)]) -> String {
    let at = |way: Way| ways().position(|one| one == way).unwrap_or(0);
    let ratio = |times: &[Time]| times[at(AT_POSES)].both / times[at(Way::Ulps(0))].both;
    let told = timed.iter().map(|(offset, times)| format!("{:.2} at {offset:e}", ratio(times)));
    let told = told.collect::<Vec<_>>().join(", ");
    format!(
        "Boxes {}, computed and searched for, take so many times the time of rapier's: {told}.",
        AT_POSES.name()
    )
}
