//! One test binary: linking rapier once is what keeps the suite fast to build.

mod finder;
mod incremental;
