//! Commands of the program `pbig-studies`, which is built apart: it needs other libraries' trees.

use pbig_harness::output::Failure;
use std::ffi::OsString;
use std::process::Command;

/// Runs a command of `pbig-studies`, if the program lies beside this one, and ends with its exit status.
pub(crate) fn run(command: &str, options: Vec<OsString>) -> Result<(), Failure> {
    let here = std::env::current_exe().map_err(|error| Failure::Input(error.to_string()))?;
    let beside = here.with_file_name(format!("pbig-studies{}", std::env::consts::EXE_SUFFIX));
    if beside.is_file() {
        let status = Command::new(&beside).arg(command).args(options).status();
        let status = status.map_err(|error| Failure::Input(format!("{}: {error}", beside.display())))?;
        std::process::exit(status.code().unwrap_or(1));
    }
    let options: Vec<_> = options.iter().map(|option| option.to_string_lossy().into_owned()).collect();
    let run =
        [&["cargo run --release -p pbig-studies --", command].map(str::to_owned)[..], &options].concat();
    let build = "cargo build --release -p pbig-studies";
    Err(Failure::Input(format!(
        "{command} belongs to the program pbig-studies, which is not beside this one: build it with `{build}`, or run: {}",
        run.join(" ")
    )))
}
