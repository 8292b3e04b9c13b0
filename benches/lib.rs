//! Benchmarks of pbig; each file beside this one is one.
