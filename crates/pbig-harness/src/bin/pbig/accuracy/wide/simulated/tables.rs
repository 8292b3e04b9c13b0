//! Tables that compare the two simulations with their references.

use super::super::super::study::{Cell, Table};
use super::super::place::{IN_WORLD, Way};
use super::{KINDS, Simulated};

pub(in super::super) fn tables(all: &[Simulated]) -> [Table; 2] {
    [in_f64(all), in_f32(all)]
}

fn in_f64(all: &[Simulated]) -> Table {
    let title = "Simulated by rapier3d-f64, its poses held in f32, all steps together";
    let columns = [
        "world",
        "offset",
        "steps",
        "pairs",
        "missed_by_boxes_in_f32",
        "of_touching_shapes",
        "missed",
        "added",
        "missed_with_3_ulps",
    ];
    let mut table = Table::new("simulated", title, &columns);
    all.iter().for_each(|one| table.row(cells(one)));
    table
}

fn in_f32(all: &[Simulated]) -> Table {
    let title = "Simulated by rapier in f32, held against rapier3d-f64, all steps together";
    let columns = [
        "world",
        "offset",
        "broad_phase",
        "missed_percent",
        "added_percent",
        "apart_at_the_end",
        "lost_bodies",
    ];
    let mut table = Table::new("simulated_in_f32", title, &columns);
    for one in all {
        for ((name, _), own) in KINDS.iter().zip(&one.own) {
            let percents = [own.pairs.missed, own.pairs.added].map(|count| Cell::from(one.percent(count)));
            let head = [one.row.world.into(), one.row.offset.into(), (*name).into()];
            table.row(head.into_iter().chain(percents).chain([own.apart.into(), (own.lost as u64).into()]));
        }
    }
    table
}

fn cells(Simulated { row, steps, .. }: &Simulated) -> Vec<Cell> {
    let (boxes, all) = (row.by_boxes(Way::Ulps(0)), row.in_all(Way::Ulps(0)));
    let head = [row.world.into(), row.offset.into(), (*steps as u64).into(), row.pairs.into()];
    let counts = [boxes.missed, boxes.missed_deep, all.missed, all.added, row.in_all(IN_WORLD).missed];
    head.into_iter().chain(counts.map(Cell::from)).collect()
}
