//! A check for each fuzz target: bytes in, a panic where a contract is broken. The test suite runs the checks too, on every
//! input that once failed.

mod engines;
mod finder;
mod input;
mod readers;
mod untrusted;
mod updates;

pub use finder::finder_against_oracle;
pub use readers::{csv_reader, npy_reader, obj_reader, ply_reader};
pub use untrusted::pairs_and_snapshots;
pub use updates::updates_against_scratch;
