//! The table of runs: a row for each way, and of the permuted ones three for all.

use super::super::study::{Cell, Table};
use super::Ways;
use super::figures::Figures;
use super::sides::{PERMUTED, WAYS, Way};

/// The columns about permuted runs: the first, the middle and the last of their sorted values.
const OF_PERMUTED: [(&str, usize); 3] = [("least", 0), ("median", PERMUTED / 2), ("most", PERMUTED - 1)];

pub(super) fn table(scenes: &[Ways]) -> Table {
    let columns = [
        "scene",
        "broad_phase",
        "contacts",
        "points",
        "deepest_mm",
        "mean_penetration_mm",
        "energy_at_the_end_percent",
        "energy_rise_percent",
        "momentum_drift_percent",
        "rest_from_step",
        "asleep_from_step",
        "awake_percent",
        "parted_in_contact",
        "differs_from_step",
        "mean_distance",
        "largest_distance",
        "missed",
        "step_ms",
    ];
    let title = format!(
        "The same scene in every way; of the {PERMUTED} permuted runs the least, the median and the most, each column for \
         itself"
    );
    let mut table = Table::new("runs", title, &columns);
    for ways in scenes {
        rows(ways).into_iter().for_each(|row| table.row(row));
    }
    table
}

/// The permuted ones where the first of them is.
fn rows(ways: &Ways) -> Vec<Vec<Cell>> {
    let all = WAYS.iter().zip(&ways.runs);
    let one = |(way, run): (&Way, &Figures)| (!way.is_permuted()).then(|| cells(ways.scene, run));
    let mut rows: Vec<_> = all.filter_map(one).collect();
    let permuted: Vec<_> = ways.yardsticks().into_iter().map(|run| cells(ways.scene, run)).collect();
    let of_permuted = OF_PERMUTED.map(|(name, place)| among(&permuted, name, place));
    let first = WAYS.iter().position(Way::is_permuted).unwrap_or(0);
    rows.splice(first..first, of_permuted);
    rows
}

/// The cells that have so many less than them, column by column.
fn among(permuted: &[Vec<Cell>], name: &str, place: usize) -> Vec<Cell> {
    let column = |k: usize| {
        let mut cells: Vec<&Cell> = permuted.iter().map(|row| &row[k]).collect();
        cells.sort_by(|a, b| size(a).total_cmp(&size(b)));
        cells[place].clone()
    };
    let mut row: Vec<Cell> = (0..permuted[0].len()).map(column).collect();
    row[1] = format!("stock permuted, {name}").into();
    row
}

/// A step that never came is later than all others.
fn size(cell: &Cell) -> f64 {
    match cell {
        Cell::Number(number) => *number,
        Cell::Count(count) => *count as f64,
        _ => f64::INFINITY,
    }
}

fn cells(scene: &str, run: &Figures) -> Vec<Cell> {
    let from =
        |step: Option<usize>| step.map_or_else(|| format!("not within {}", run.steps).into(), Cell::from);
    vec![
        scene.into(),
        run.way.into(),
        run.contacts.into(),
        run.points.into(),
        run.deepest.into(),
        run.penetration.into(),
        run.energy.into(),
        run.rise.into(),
        run.momentum.into(),
        from(run.rest),
        from(run.asleep),
        run.awake.into(),
        run.parted.into(),
        run.differs.into(),
        run.apart.mean.into(),
        run.apart.max.into(),
        run.reported.missed.into(),
        run.ms.into(),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::figures::tests::nothing;
    use super::*;

    #[test]
    fn of_permuted_runs_each_column_is_sorted_for_itself() {
        let run = |(k, way): (usize, &Way)| Figures {
            way: way.name,
            contacts: k as f64,
            points: 100.0 - k as f64,
            rest: (k % 2 == 0).then_some(k),
            ..nothing()
        };
        let runs: Vec<Figures> = WAYS.iter().enumerate().map(run).collect();
        let rows = rows(&Ways { scene: "pile", runs, instants: vec![], repeats: vec![] });
        assert_eq!(rows.len(), WAYS.len() - PERMUTED + OF_PERMUTED.len());
        let names: Vec<String> = rows.iter().map(|row| row[1].text()).collect();
        let permuted = ["stock permuted, least", "stock permuted, median", "stock permuted, most"];
        assert_eq!(
            (&names[..2], &names[2..5], &names[5][..]),
            (
                &["stock".to_owned(), "stock again".into()][..],
                &permuted.map(str::to_owned)[..],
                "stock sorted"
            )
        );
        let column = |k: usize| [2, 3, 4].map(|row: usize| rows[row][k].clone());
        assert_eq!(column(2), [2.0, 11.0, 20.0].map(Cell::Number));
        assert_eq!(column(3), [80.0, 89.0, 98.0].map(Cell::Number));
        let never = Cell::Text("not within 100".into());
        assert_eq!(column(9), [Cell::Count(2), Cell::Count(20), never]);
    }
}
