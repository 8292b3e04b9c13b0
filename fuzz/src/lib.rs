//! The checks that are fuzzed. The files in `checks` are compiled twice, here with instruments, and in the test suite, where
//! seeds and every input that once failed are run again without any.

// The readers' own files rather than their crate, which would bring wgpu and rapier.
#[path = "../../crates/pbig-harness/src/files.rs"]
pub mod files;
#[path = "../../crates/pbig-harness/src/hard.rs"]
pub mod hard;
#[path = "../../crates/pbig-harness/src/pair_index.rs"]
pub mod pair_index;
#[path = "../../crates/pbig-harness/src/pbig_grid.rs"]
pub mod pbig_grid;

pub mod checks;
pub use checks::*;
