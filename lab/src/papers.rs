//! The experiments of PBIG's and Avril's papers, the printed numbers beside ours.
//!
//! *PBIG*: Lo, Lee, Chung, Chung, "Optimizing Pairwise Box Intersection Checking on GPUs for Large-Scale Simulations", ACM TOMACS
//! 23(3), 2013; times on a Tesla C2070. *Avril*: Avril, Gouranton, Arnaldi, "Fast Collision Culling in Large-Scale Environments
//! Using GPU Mapping Function", EGPGV 2012; times on a Quadro FX 3600M. The printed numbers are in `printed`, each with its place.

mod avril;
mod figures;
mod model;
pub(crate) mod printed;
mod roots;
mod sides;
mod table_iii;

use crate::UNSORTED;
use pbig_core::{Config, Engine};
use pbig_harness::chart::Chart;
use pbig_harness::prelude::*;
use sides::Setup;

/// Our grid on the CPU, however few the boxes.
const OUR_GRID: Config = Config { engine: Some(Engine::Grid), ..UNSORTED };

type Section = fn(&Setup) -> Result<Vec<Table>, Failure>;

const PARTS: [Section; 4] = [table_iii::tables, figures::tables, roots::tables, avril::tables];

/// Makes all tables. Fails if two ways to search find different pairs.
pub fn run(quick: bool) -> Result<BenchReport, Failure> {
    let setup = Setup::new(quick);
    let mut tables = vec![];
    for part in tracked(PARTS, "parts") {
        tables.extend(part(&setup)?);
    }
    tables.push(figures::sizes());
    let charts = charts(&tables, setup.is_software());
    let head = vec![("software", setup.is_software().to_string()), ("adapter", setup.adapter)];
    Ok(BenchReport { head, charts, ..BenchReport::new("papers", tables) })
}

/// Draws PBIG's figures 8 and 9 and Avril's figure 5. Times of a software adapter say nothing about a GPU, so it has no line.
fn charts(tables: &[Table], is_software: bool) -> Vec<Chart> {
    let gpu = "pbig, GPU";
    let table = |start: &str| tables.iter().find(|table| table.name.starts_with(start)).expect("made before");
    let (uniform, cells, steps) = (table("PBIG figure 8"), table("PBIG figure 9"), table("Avril table 6"));
    let of_uniform = [
        ("pbig's grid, CPU", "ms, our grid, CPU"),
        ("PBIG's grid, CPU, one thread", "ms, PBIG's grid, CPU, one thread"),
        (gpu, "ms, GPU"),
    ];
    let of_uniform =
        of_uniform.map(|(name, y)| uniform.line(name, ["boxes", y], |_| name != gpu || !is_software));
    let mut sizes: Vec<_> = cells.column("boxes").collect();
    sizes.dedup();
    let of_size = |size: &Value| {
        let columns = ["cell", "ms, PBIG's grid, CPU, one thread"];
        let mut line = cells.line(&format!("{size} boxes"), columns, |row| row[0] == *size);
        line.points.sort_by(|a, b| a.0.total_cmp(&b.0));
        line
    };
    let of_steps = [("printed", "printed"), ("pbig, CPU", "ours, CPU"), (gpu, "ours, GPU")];
    let is_drawn = |row: &[Value], side: &str| row[1] == side && !(is_software && side == "ours, GPU");
    let of_steps =
        of_steps.map(|(name, side)| steps.line(name, ["objects", "whole, ms"], |row| is_drawn(row, side)));
    let of_cells = sizes.into_iter().map(of_size).collect();
    let chart = |name, title, x, lines| Chart::log(name, title, [x, "time, ms"], lines);
    vec![
        chart("papers-uniform", "PBIG figure 8: uniform boxes", "boxes", of_uniform.into()),
        chart(
            "papers-cells",
            "PBIG figure 9: size of cells",
            "length of a cell, in the paper's unit",
            of_cells,
        ),
        chart("papers-steps", "Avril figure 5: a step, all moving", "objects", of_steps.into()),
    ]
}
