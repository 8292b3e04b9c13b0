//! The viewer. `cargo run --release -- --help`

use std::process::ExitCode;

fn main() -> ExitCode {
    pbig_viewer::main()
}
