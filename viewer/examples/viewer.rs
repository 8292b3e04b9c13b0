//! The viewer as an example: `cargo run --release -p pbig-viewer --example viewer`

use std::process::ExitCode;

fn main() -> ExitCode {
    pbig_viewer::main()
}
