//! A check for each fuzz target: bytes in, a panic where a contract is broken.

mod bounded;
mod engines;
mod finder;
mod input;
mod readers;
mod updates;
mod words;

pub use bounded::work_is_bounded;
pub use finder::finder_against_oracle;
pub use readers::{csv_reader, npy_reader};
pub use updates::updates_against_scratch;
pub use words::decode_words;
