//! The CPU backend. `map` sorts boxes into cells (`cells`, `entries`; `crowding` where
//! many share few), `find` searches them (`half`
//! within a grid, `check` across grids), `emit` orders the pairs. `pbig` is the paper's grid, plain
//! and scalar.

mod cells;
pub(crate) mod check;
pub(crate) mod crowding;
pub(crate) mod emit;
mod entries;
pub(crate) mod find;
mod half;
pub(crate) mod map;
pub(crate) mod pbig;
