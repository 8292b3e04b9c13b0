//! The CPU backend: `map` sorts boxes into cells, `check` tests candidates, `emit` orders pairs.
//! `pbig` is the paper's grid, the scalar twin of the GPU kernels.

pub(crate) mod check;
pub(crate) mod emit;
pub(crate) mod map;
pub(crate) mod pbig;
