//! The viewer. `cargo run --release -p pbig-viewer -- --help`

use std::process::ExitCode;

fn main() -> ExitCode {
    pbig_viewer::main()
}
