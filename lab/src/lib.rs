//! The papers' experiments, run time against error, and pbig beside other trees. Programs write numbers; what follows from
//! them is in docs/.

pub mod accuracy;
pub mod hard;
mod index;
pub mod papers;
mod pbig_grid;
pub mod peers;
pub mod steady;
mod trees;
pub mod worst;

use pbig_core::{Config, Limits, Order};

/// Unlimited and in no order, as the papers' programs and the other trees.
const UNSORTED: Config = Config { order: Order::Unspecified, ..UNLIMITED };

/// The default without limits.
const UNLIMITED: Config = Config { limits: Limits::UNLIMITED, ..Config::DEFAULT };
