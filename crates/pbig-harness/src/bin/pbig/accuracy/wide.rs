//! f32 against f64: the same worlds from the origin to 10^7 from it, as laid out and as rapier3d-f64 simulates them, the
//! pairs that boxes in f32 miss or add, and what widening them by ulps does about it.
//!
//! Two things are rounded. Poses: rapier holds another world than the one that was meant, and no broad phase can
//! tell. And boxes, which are computed in f32 from these poses: that is what a broad phase answers for. So there are
//! two truths, in f64 both, and what differs is counted against each.

mod notes;
mod place;
mod simulated;
mod times;

use super::study::{Cell, Point, Study, Table};
use crate::output::Failure;
use place::{AT_POSES, Along, IN_WORLD, Place, Row, WAYS, Way, World, ulp, worlds};
use times::{Time, times, ways};

const OFFSETS: [f64; 7] = [0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let worlds = worlds(if quick { 500 } else { 12_000 })?;
    let (rows, simulated) = (rows(&worlds)?, simulated::simulated(&OFFSETS, quick)?);
    rows.iter().chain(simulated.iter().map(|one| &one.row)).try_for_each(check)?;
    let timed = all_times(&worlds[0], quick)?;
    Ok(Study {
        name: "wide",
        title: "f32 far from the origin",
        notes: [notes::notes(&rows, &timed), simulated::notes(&simulated)].concat(),
        tables: tables(&rows, &simulated, &timed),
        time: "ns per box, computed and searched for",
        error: "pairs missed and added, % of those in f64 (crowd, along the diagonal)",
        points: points(&rows, &timed),
        joined: true,
    })
}

fn tables(rows: &[Row], simulated: &[simulated::Simulated], timed: &[(f64, Vec<Time>)]) -> Vec<Table> {
    let others = [sizes_table(rows), ways_table(rows), times_table(timed)];
    [pairs_table(rows)].into_iter().chain(simulated::tables(simulated)).chain(others).collect()
}

fn rows(worlds: &[World]) -> Result<Vec<Row>, Failure> {
    let all = |world: &'_ World| {
        let x = world.along_x.then_some(Along::X);
        let everywhere = [Some(Along::Diagonal), x].into_iter().flatten();
        everywhere.flat_map(|along| OFFSETS.map(|offset| (offset, along))).collect::<Vec<_>>()
    };
    let places = worlds.iter().flat_map(|world| all(world).into_iter().map(move |place| (world, place)));
    // At the origin all directions are the same.
    let places = places.filter(|(_, (offset, along))| *offset > 0.0 || *along == Along::Diagonal);
    places.map(|(world, (offset, along))| Row::new(world, offset, along)).collect()
}

/// Checks the proved statements: no pair is missed by boxes that are widened by 2 ulps, at the poses that rapier
/// holds; by 3, in the world; by boxes in f64 that are rounded outward; nor, at the poses, as far out as the margin
/// does.
fn check(row: &Row) -> Result<(), Failure> {
    let near = row.offset < notes::covered();
    let promised = [
        (true, AT_POSES, row.by_boxes(AT_POSES).missed),
        (true, IN_WORLD, row.in_all(IN_WORLD).missed),
        (true, Way::Outward, row.in_all(Way::Outward).missed),
        (near, Way::Margin(0), row.by_boxes(Way::Margin(0)).missed),
    ];
    if let Some((_, way, missed)) = promised.into_iter().find(|&(holds, _, missed)| holds && missed > 0) {
        let Row { world, offset, .. } = row;
        let way = way.name();
        return Err(Failure::Check(format!("{world}, {offset} away, {way}: {missed} pairs missed")));
    }
    Ok(())
}

/// The times of a world at each offset.
fn all_times(world: &World, quick: bool) -> Result<Vec<(f64, Vec<Time>)>, Failure> {
    let one = |offset| Ok((offset, times(&Place::new(&world.layout, offset, Along::Diagonal), quick)?));
    OFFSETS.into_iter().map(one).collect()
}

fn pairs_table(rows: &[Row]) -> Table {
    let title = "Rapier's boxes: what rounding poses does, what rounding boxes does, and both";
    let columns = [
        "world",
        "along",
        "offset",
        "ulp",
        "pairs",
        "missed_by_poses",
        "added_by_poses",
        "missed_by_boxes",
        "of_touching_shapes",
        "added_by_boxes",
        "missed",
        "added",
        "largest_shortfall_in_ulps_of_widening",
    ];
    let mut table = Table::new("pairs", title, &columns);
    for row in rows {
        let (boxes, all) = (row.by_boxes(Way::Ulps(0)), row.in_all(Way::Ulps(0)));
        let cells =
            [row.pairs, row.poses.missed, row.poses.added, boxes.missed, boxes.missed_deep, boxes.added];
        let head =
            [Cell::from(row.world), along(row.along).into(), row.offset.into(), coarseness(row).into()];
        let counts = cells.into_iter().chain([all.missed, all.added]).map(Cell::from);
        table.row(head.into_iter().chain(counts).chain([row.shortfall.into()]));
    }
    table
}

fn along(along: Along) -> &'static str {
    match along {
        Along::Diagonal => "diagonal",
        Along::X => "x",
    }
}

/// Of a position there; near the origin of a shape's size.
fn coarseness(row: &Row) -> f64 {
    ulp(row.offset.max(row.size))
}

/// By size over ulp: what a world is like that rapier holds.
fn sizes_table(rows: &[Row]) -> Table {
    let title =
        "The crowd along the diagonal: shapes as large as so many ulps, and pairs that are wrong, in percent";
    let columns = [
        "size",
        "offset",
        "size_in_ulps",
        "pairs",
        "missed_by_poses_percent",
        "added_by_poses_percent",
        "missed_percent",
        "added_percent",
        "missed_with_2_ulps_percent",
        "added_with_2_ulps_percent",
    ];
    let mut table = Table::new("sizes", title, &columns);
    let mut rows: Vec<&Row> = rows.iter().filter(|row| notes::is_crowd(row)).collect();
    rows.sort_by(|a, b| b.size_in_ulps().total_cmp(&a.size_in_ulps()));
    for row in rows {
        let percent = |count: u64| Cell::from(count as f64 / row.pairs.max(1) as f64 * 100.0);
        let counts = [row.poses, row.in_all(Way::Ulps(0)), row.in_all(AT_POSES)];
        let head = [row.size.into(), row.offset.into(), row.size_in_ulps().into(), row.pairs.into()];
        table.row(head.into_iter().chain(counts.into_iter().flat_map(|d| [d.missed, d.added]).map(percent)));
    }
    table
}

/// All worlds and directions together.
fn ways_table(rows: &[Row]) -> Table {
    let title = "Ways to boxes in f32, all worlds together";
    let columns = [
        "offset",
        "boxes",
        "pairs_at_the_poses",
        "missed_at_the_poses",
        "of_touching_shapes",
        "pairs",
        "missed",
        "added",
        "added_percent",
    ];
    let mut table = Table::new("ways", title, &columns);
    for (offset, way) in OFFSETS.into_iter().flat_map(|offset| WAYS.map(|way| (offset, way))) {
        let sum = |of: &dyn Fn(&Row) -> u64| notes::sum(rows, offset, of);
        let (pairs, added) = (sum(&|row| row.pairs), sum(&|row| row.in_all(way).added));
        table.row([
            offset.into(),
            way.name().into(),
            sum(&|row| row.held_pairs).into(),
            sum(&|row| row.by_boxes(way).missed).into(),
            sum(&|row| row.by_boxes(way).missed_deep).into(),
            pairs.into(),
            sum(&|row| row.in_all(way).missed).into(),
            added.into(),
            Cell::from(added as f64 / pairs.max(1) as f64 * 100.0),
        ]);
    }
    table
}

fn times_table(timed: &[(f64, Vec<Time>)]) -> Table {
    let title = "The crowd along the diagonal: ns per box";
    let columns = ["offset", "boxes", "to_compute_ns", "to_compute_and_search_for_ns"];
    let mut table = Table::new("times", title, &columns);
    for (offset, times) in timed {
        for (way, time) in ways().zip(times) {
            table.row([(*offset).into(), way.name().into(), time.boxes.into(), time.both.into()]);
        }
    }
    table
}

fn points(rows: &[Row], timed: &[(f64, Vec<Time>)]) -> Vec<Point> {
    let crowd =
        |offset: f64| rows.iter().find(|row| notes::is_crowd(row) && row.size == 1.0 && row.offset == offset);
    let mut points = Vec::new();
    for (k, way) in ways().enumerate() {
        for (offset, times) in timed {
            let Some(row) = crowd(*offset) else { continue };
            let error = row.wrong_percent(way);
            points.push(Point { series: way.name(), time: times[k].both, error });
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_study_misses_pairs_without_ulps_and_none_with_them() {
        let study = run(true).expect("no failure");
        let [pairs, simulated, _, sizes, ways, times] = &study.tables[..] else { panic!("six tables") };
        assert_eq!(pairs.rows.len(), 6 * OFFSETS.len() + 4 * (OFFSETS.len() - 1));
        assert_eq!(simulated.rows.len(), OFFSETS.len());
        assert_eq!((sizes.rows.len(), ways.rows.len()), (3 * OFFSETS.len(), WAYS.len() * OFFSETS.len()));
        assert_eq!(times.rows.len(), study.points.len());
        let missed = |way: Way| {
            let rows = ways.rows.iter().filter(|row| row[1] == Cell::from(way.name()));
            rows.filter(|row| row[3] != Cell::Count(0)).count()
        };
        assert!(missed(Way::Ulps(0)) > 0 && missed(AT_POSES) == 0);
        assert!(study.notes.iter().all(|note| !note.contains("NaN")), "{:?}", study.notes);
    }

    #[test]
    fn a_missed_pair_that_was_promised_is_a_failed_check() {
        let worlds = worlds(50).expect("worlds");
        let mut row = Row::new(&worlds[0], 1e3, Along::X).expect("a row");
        assert!(check(&row).is_ok());
        row.ways[Way::Ulps(1).index()][0].missed = 5;
        assert!(check(&row).is_ok(), "nobody promises that of one");
        row.ways[Way::Margin(0).index()][0].missed = 5;
        assert!(check(&row).is_err_and(|failure| failure.to_string().contains("5 pairs missed")));
        row.offset = 1e6;
        assert!(check(&row).is_ok(), "as far away the margin is lost");
        row.ways[IN_WORLD.index()][1].missed = 7;
        assert!(check(&row).is_err_and(|failure| failure.to_string().contains("by 3 ulps: 7 pairs")));
    }
}
