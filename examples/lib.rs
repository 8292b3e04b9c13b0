//! Runnable examples of pbig; each file beside this one is a program of its own.

/// Runs the programs in the first steps as tests.
#[cfg(doctest)]
#[doc = include_str!("../docs/GETTING_STARTED.md")]
struct GettingStarted;

/// Runs the programs in the repository's README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
