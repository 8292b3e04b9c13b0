//! A check for each fuzz target: bytes in, a panic where a contract is broken. The test suite runs the checks too, on every
//! input that once failed.

mod between;
mod bounded;
mod engines;
mod finder;
mod input;
mod readers;
mod updates;
mod words;

pub use between::between_against_oracle;
pub use bounded::work_is_bounded;
pub use finder::finder_against_oracle;
pub use readers::{csv_reader, npy_reader, obj_reader, ply_reader};
pub use updates::updates_against_scratch;
pub use words::decode_words;
