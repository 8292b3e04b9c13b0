//! The checks that are fuzzed. The files in `checks` are compiled twice, here with instruments, and in the test suite, where
//! seeds and every input that once failed are run again without any.

// The decoder's and the readers' own files rather than their crates: these would bring wgpu and rapier.
pub use pbig_core::{Aabb, Pair, ProxyFilter};
#[path = "../../crates/pbig-core/src/decode.rs"]
pub mod decode;
#[path = "../../crates/pbig-harness/src/files.rs"]
pub mod files;
#[path = "../../crates/pbig-harness/src/hard.rs"]
pub mod hard;
#[path = "../../crates/pbig-core/src/layout.rs"]
pub mod layout;
#[path = "../../crates/pbig-harness/src/pair_index.rs"]
pub mod pair_index;
#[allow(dead_code, reason = "the decoder needs a part of it")]
#[path = "../../crates/pbig-core/src/parallel.rs"]
mod parallel;
#[path = "../../crates/pbig-harness/src/pbig_grid.rs"]
pub mod pbig_grid;

pub mod checks;
pub use checks::*;
