//! The plan in a report: what was done, and why, in words.

use crate::Aabb;
use crate::policy::NoDevice;
use std::fmt;

/// The algorithm that did the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Algorithm {
    /// None: fewer than two boxes can meet, because others are invalid or far from the other set; or nothing has changed.
    #[default]
    Nothing,
    /// Every pair was tested.
    Brute,
    /// All boxes were sorted into a grid and searched.
    Grid,
    /// All boxes were sorted into a tree, as cells would hold too many, and paired by it, or by streamed segment trees where they
    /// cross.
    Tree,
    /// Changed boxes were looked up in a tree, and what they overlap was compared with their kept pairs.
    LookUp,
    /// A device did the work, see [`crate::PairDevice`].
    Device,
}

impl Algorithm {
    /// Returns the name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Brute => "brute",
            Self::Grid => "grid",
            Self::Tree => "tree",
            Self::LookUp => "look-up",
            Self::Device => "device",
        }
    }
}

/// The cells that a search visits for each box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NeighbourScan {
    /// Half of the 27 neighbouring cells, as five runs of sorted boxes, even if empty: fastest where cells hold few boxes.
    #[default]
    Runs,
    /// The cells in which an overlapping box can lie: fastest where cells hold many. Two sets always have these.
    Windows,
}

/// A cell of a grid with the boxes whose lower corners lie in it, or a leaf of a tree with its boxes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OccupiedCell {
    /// The cell; a border cell reaches to the lower corners of the boxes beyond the border.
    pub aabb: Aabb,
    /// The ids of the boxes.
    pub ids: Vec<u32>,
}

/// The algorithm of a call and its data. `Display` puts it in words.
///
/// ```
/// use pbig_core::{Aabb, Finder};
/// let boxes: Vec<_> = (0..500).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.6; 3])).collect();
/// let mut finder = Finder::default();
/// finder.find(&boxes)?;
/// println!("{}", finder.report().plan);
/// # Ok::<(), pbig_core::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Plan {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// Valid boxes.
    pub boxes: u32,
    /// Lower corner of the first cell, in the boxes' length unit.
    pub origin: [f64; 3],
    /// Edges of a cell, in the boxes' length unit ([`Algorithm::Grid`]).
    pub cell: [f32; 3],
    /// Cells by axis.
    pub dims: [u32; 3],
    /// The cells that were visited for each box.
    pub scan: NeighbourScan,
    /// Boxes larger than a cell, tested against all boxes that they reach.
    pub oversize: u32,
    /// The device's plan in words ([`Algorithm::Device`]); none where every pair was tested.
    pub device: Option<String>,
    /// The reason that kept a call from a device.
    pub no_device: Option<NoDevice>,
}

impl Plan {
    fn write_cells(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([x, y, z], [dx, dy, dz]) = (self.cell, self.dims);
        write!(f, "; {dx} x {dy} x {dz} cells of {x:.3} x {y:.3} x {z:.3}")?;
        if self.scan == NeighbourScan::Windows {
            write!(f, ", of which only those in reach are visited")?;
        }
        if self.oversize > 0 {
            write!(f, "; {} oversize boxes are tested against all in reach", self.oversize)?;
        }
        Ok(())
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let boxes = self.boxes;
        match self.algorithm {
            Algorithm::Nothing if boxes < 2 => write!(f, "nothing to do: fewer than two boxes can meet")?,
            Algorithm::Nothing => write!(f, "nothing to do: no box has changed")?,
            Algorithm::Brute => write!(f, "brute force: every pair of {boxes} boxes is tested")?,
            Algorithm::Tree => write!(f, "tree: cells would hold too many of {boxes} boxes")?,
            Algorithm::LookUp => write!(f, "look-up: few of {boxes} boxes have changed")?,
            Algorithm::Device => match &self.device {
                Some(plan) => write!(f, "device: {boxes} boxes; {plan}")?,
                None => write!(f, "device: {boxes} boxes, every pair is tested")?,
            },
            Algorithm::Grid => write!(f, "grid: {boxes} boxes are sorted and searched")?,
        }
        if self.algorithm == Algorithm::Grid {
            self.write_cells(f)?;
        }
        // Where no device was given nobody expects one.
        match self.no_device {
            Some(why) if why != NoDevice::NotGiven => write!(f, "; no device: {why}"),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_algorithm_says_why_no_device_was_used() {
        use Algorithm::{Brute, Grid, LookUp, Nothing, Tree};
        for algorithm in [Nothing, Brute, Grid, Tree, LookUp] {
            let shown = |no_device| Plan { algorithm, boxes: 9, no_device, ..Plan::default() }.to_string();
            assert!(shown(Some(NoDevice::Software)).ends_with("; no device: the given one is software"));
            assert_eq!(shown(Some(NoDevice::NotGiven)), shown(None));
        }
    }
}
