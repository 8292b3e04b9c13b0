//! The package of one example, `main.rs`. Cargo asks for a library beside it.
