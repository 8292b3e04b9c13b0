//! One test binary: linking rapier once is what keeps the suite fast to build.

mod checked;
mod drop_in;
mod finder;
mod gpu;
mod incremental;
mod kernels;
mod planted;
mod worlds;
