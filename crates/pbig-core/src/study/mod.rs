//! For tests and studies, not for products: PBIG's grid on the CPU, and the cell sizes of the papers.
//!
//! [`pbig_grid`] is the plain scalar twin of the GPU kernels. It searches as the paper does (Lo et al. 2013): every box has
//! an entry in each cell that it touches, and pairs are tested within a cell.
//!
//! This module needs the feature `unstable-study`. It may change in any release.

mod grid;
mod plan;

pub use crate::pbig::{SizeClass, Summary, density_cell, pbig_cell, pbig_objective};
pub use grid::{PbigFound, pbig_grid};
pub use plan::PbigPlan;
