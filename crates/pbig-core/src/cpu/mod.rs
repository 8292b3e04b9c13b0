//! The CPU backend. `map` sorts boxes into cells (`levels`, `cells`, `sort`; `crowding` where many share few; `edit` and `spill` where few move), `find`
//! searches them: `half` within a level and `window` across levels leave candidates, by `codes`, which `judge` tests;
//! `check` tests `entries` that fit no level; all into buffers of `found`. `bitmap` is for few boxes (`bands`). `emit` orders the pairs. `pbig` is the
//! paper's grid, plain and scalar.

mod bands;
pub(crate) mod bitmap;
mod calibrate;
mod cells;
pub(crate) mod check;
pub(crate) mod codes;
pub(crate) mod crowding;
pub(crate) mod edit;
pub(crate) mod emit;
mod entries;
pub(crate) mod find;
pub(crate) mod found;
mod half;
pub(crate) mod judge;
mod levels;
pub(crate) mod map;
pub(crate) mod pbig;
pub(crate) mod record;
mod sort;
mod spill;
mod window;
