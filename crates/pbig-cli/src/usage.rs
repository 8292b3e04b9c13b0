//! Messages about the arguments, in one line as for any other bad input; clap's own have several.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use pbig_harness::output::Failure;
use std::error::Error;
use std::ffi::OsString;

/// Returns clap's message in one line, with the command whose help has the options.
pub(crate) fn failure(error: &clap::Error, cli: &clap::Command, first: Option<OsString>) -> Failure {
    let command = first.and_then(|name| cli.find_subcommand(name));
    let command = command.map_or(String::new(), |command| format!("{} ", command.get_name()));
    Failure::Input(format!("{} (see pbig {command}--help)", line(error)))
}

fn line(error: &clap::Error) -> String {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text,
        _ => "",
    };
    match (error.kind(), error.source()) {
        (ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand, _) => {
            "a command is missing: pairs, replay, simulate, scenes, bench, accuracy or doctor".into()
        }
        (ErrorKind::ValueValidation, Some(why)) => {
            let option = text(ContextKind::InvalidArg).split(' ').next().unwrap_or_default();
            format!("{option} {}: {why}", text(ContextKind::InvalidValue))
        }
        _ => first_paragraphs(&error.to_string()),
    }
}

/// Returns the message without usage and tips. Tips are guesses, and often wrong.
fn first_paragraphs(message: &str) -> String {
    let lines = message.lines().map(str::trim).filter(|line| !line.is_empty());
    let rest = ["tip:", "Usage:", "For more"];
    let told: Vec<&str> =
        lines.take_while(|line| !rest.iter().any(|start| line.starts_with(start))).collect();
    told.join(" ").trim_start_matches("error: ").to_string()
}
