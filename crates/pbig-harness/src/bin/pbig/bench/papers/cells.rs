//! PBIG's cells: how many checks cells of a given length make, by calculation, and which length the paper's
//! rule gives (section 4.1, equations 2 to 6).

use super::model::{Edges, Model, Space};
use super::printed::WARP;
use pbig_core::Aabb;
use pbig_harness::study::{PbigCells, PbigSettings, SETTINGS};

/// Cells from 0 on along an axis of even boxes, of which the last may be cut off.
fn along(length: f64, cell: f64) -> f64 {
    (length / cell).ceil().max(1.0)
}

/// The length of the space of a law whose boxes lie evenly; of another the width of four deviations.
fn length(model: &Model) -> f64 {
    match model.space {
        Space::Even(length) => length,
        Space::Normal([_, deviation]) => 4.0 * deviation,
    }
}

/// Expected checks of `n` even boxes placed by their lower corners: two boxes are tested in each cell that
/// both touch. Axes are independent, so it is half of `n^2` times the third power of a sum over the cells of
/// one axis: a box touches the first if its corner lies there, the others also if it reaches there from
/// below, and what lies beyond the space counts as the last.
pub(super) fn expected_checks(model: &Model, n: usize, cell: f64) -> f64 {
    let (length, mean) = (length(model), model.edges.mean());
    let cells = along(length, cell);
    let touched = |i: f64| {
        let own = (length - i * cell).min(cell);
        let reach = if i > 0.0 { mean } else { 0.0 };
        ((own + reach) / length).min(1.0)
    };
    let both: f64 = (0..cells as u64).map(|i| touched(i as f64).powi(2)).sum();
    let n = n as f64;
    0.5 * n * (n - 1.0) * both.powi(3)
}

/// `alpha`, the cells that a box touches on average.
#[derive(Clone, Copy, Debug)]
pub(super) enum Alpha {
    /// Those it does touch, wherever it lies: one more than it has cell lengths.
    Touched,
    /// Equation 5: its length in cells, rounded up.
    Equation5,
}

impl Alpha {
    fn of(self, edges: &Edges, cell: f64) -> f64 {
        let on_axis = match self {
            Self::Touched => 1.0 + edges.mean() / cell,
            Self::Equation5 => mean_of_ceilings(edges, cell),
        };
        on_axis.powi(3)
    }

    /// `f` of equation 2.
    pub(super) fn objective(self, model: &Model, n: usize, cell: f64) -> f64 {
        let cells = match self {
            Self::Touched => length(model) / cell,
            Self::Equation5 => along(length(model), cell),
        };
        n as f64 * self.of(&model.edges, cell) / cells.powi(3)
    }

    /// Equation 6 among the powers of two: the shortest cell with at least a warp of boxes.
    pub(super) fn cell(self, model: &Model, n: usize) -> Option<f64> {
        (0..14).map(|k| f64::from(1 << k)).find(|&cell| self.objective(model, n, cell) >= WARP)
    }
}

/// The mean of `ceil(e / cell)` for lengths uniform between two.
fn mean_of_ceilings(edges: &Edges, cell: f64) -> f64 {
    let whole = |e: f64| {
        let full = (e / cell).floor();
        // The integral of the ceiling from 0 to e.
        cell * full * (full + 1.0) / 2.0 + (e - full * cell) * (full + 1.0)
    };
    match edges.high - edges.low {
        0.0 => (edges.low / cell).ceil(),
        width => (whole(edges.high) - whole(edges.low)) / width,
    }
}

/// Settings with which PBIG's grid has cells as close to `cell` as its rule can be made to give.
pub(super) fn settings_for(boxes: &[Aabb], cell: f64) -> PbigSettings {
    let cells = PbigCells::new(boxes);
    let with = |wanted: f64| PbigSettings { boxes_per_cell: wanted as f32, ..SETTINGS };
    let (mut low, mut high) = (1.0, boxes.len().max(2) as f64);
    for _ in 0..40 {
        let middle: f64 = (low * high).sqrt();
        let given = f64::from(cells.length(&with(middle)));
        if given < cell { low = middle } else { high = middle }
    }
    with(high)
}

#[cfg(test)]
mod tests {
    use super::super::model::Place;
    use super::*;

    fn model() -> Model {
        let edges = Edges::boxes(0.0, 10.0);
        Model { space: Space::Even(100.0), place: Place::LowerCorner, edges }
    }

    /// Tests in each cell, counted box by box.
    fn counted(boxes: &[Aabb], length: f64, cell: f64) -> u64 {
        let last = along(length, cell) - 1.0;
        let index = |x: f32| (f64::from(x) / cell).floor().min(last) as usize;
        let side = last as usize + 1;
        let mut cells = vec![0u64; side.pow(3)];
        for b in boxes {
            for x in index(b.min[0])..=index(b.max[0]) {
                for y in index(b.min[1])..=index(b.max[1]) {
                    (index(b.min[2])..=index(b.max[2])).for_each(|z| cells[(z * side + y) * side + x] += 1);
                }
            }
        }
        cells.iter().map(|n| n * n.saturating_sub(1) / 2).sum()
    }

    #[test]
    fn the_expected_checks_are_those_of_boxes_put_into_cells() {
        for cell in [12.0, 20.0, 33.0, 100.0] {
            let counts = (0..4).map(|seed| counted(&model().boxes(3000, seed), 100.0, cell));
            let mean = counts.sum::<u64>() as f64 / 4.0;
            let expected = expected_checks(&model(), 3000, cell);
            assert!((mean / expected - 1.0).abs() < 0.02, "cells of {cell}: {mean}, {expected} expected");
        }
    }

    #[test]
    fn ceilings_by_hand() {
        // Lengths 0 to 10 in cells of 4: 1, 2 and 3 cells for 4, 4 and 2 of 10.
        assert!((mean_of_ceilings(&Edges::boxes(0.0, 10.0), 4.0) - 1.8).abs() < 1e-12);
        assert!((mean_of_ceilings(&Edges::boxes(5.0, 9.0), 4.0) - 2.25).abs() < 1e-12);
        assert_eq!(mean_of_ceilings(&Edges::equal(5.0), 4.0), 2.0);
    }

    #[test]
    fn settings_give_the_cells_that_are_asked_for() {
        let boxes = model().boxes(20_000, 1);
        for cell in [5.0, 10.0, 25.0] {
            let given = f64::from(PbigCells::new(&boxes).length(&settings_for(&boxes, cell)));
            assert!((given / cell - 1.0).abs() < 0.06, "{cell}: {given}");
        }
    }
}
