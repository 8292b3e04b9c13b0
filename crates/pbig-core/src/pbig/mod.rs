//! Planning of PBIG's grid (Lo et al. 2013): statistics of the boxes, and cell sizes by their density.
//!
//! The GPU plans its levels with this, and `study::pbig_grid` its single grid.

pub(crate) mod cell_size;
pub(crate) mod summary;

#[cfg(feature = "unstable-study")]
pub use cell_size::{density_cell, pbig_cell, pbig_objective};
#[cfg(feature = "unstable-study")]
pub use summary::SizeClass;
pub use summary::Summary;
