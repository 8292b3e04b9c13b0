//! The papers' experiments, run time against error, and pbig beside other trees. Programs write numbers; what follows from
//! them is in docs/.

pub mod accuracy;
pub mod index;
pub mod mechanics;
pub mod numbered;
pub mod papers;
pub mod peers;
pub mod precision;
pub mod reported;
pub mod sorted;
pub mod stages;
pub mod steady;
pub mod study;
mod trees;
pub mod wide;
