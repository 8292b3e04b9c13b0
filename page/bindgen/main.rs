//! Writes the JavaScript that a browser needs beside a WebAssembly module: `bindgen MODULE FOLDER`.
//!
//! One lock file holds this program and the module, so both always have the same version of wasm-bindgen.

use std::process::ExitCode;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [module, folder] = arguments.as_slice() else {
        eprintln!("usage: bindgen MODULE FOLDER");
        return ExitCode::from(2);
    };
    match write_bindings(module, folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{module}: {error}");
            ExitCode::FAILURE
        }
    }
}

fn write_bindings(module: &str, folder: &str) -> Result<(), String> {
    let mut bindgen = Bindgen::new();
    let web = bindgen.web(true).map_err(|error| error.to_string())?;
    web.typescript(false).input_path(module).generate(folder).map_err(|error| format!("{error:#}"))
}
