//! `pbig accuracy`: run time against error, a study for each thing that can be wrong by a little.
//!
//! A study is a module with `run(quick) -> Result<Study, Failure>`, and a line in [`STUDIES`].

mod coordinates;
mod index;
mod margin;
mod simulation;
mod study;
mod wide;

use crate::bench::machine::{Machine, slug};
use crate::bench::{DOCUMENTS, keep, save};
use crate::output::{Failure, print, progress};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use study::Study;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Write the charts into this folder too.
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
    /// Small sizes only, in less than a minute; no document is written.
    #[arg(long)]
    quick: bool,
    /// This study alone; no document is written.
    #[arg(long, value_name = "STUDY", value_parser = names())]
    only: Option<String>,
}

/// Makes a study, of small sizes if it is to be quick.
type Run = fn(bool) -> Result<Study, Failure>;

/// Every study by name, in the order of the document.
const STUDIES: [(&str, Run); 5] = [
    ("index", index::run),
    ("coordinates", coordinates::run),
    ("margin", margin::run),
    ("wide", wide::run),
    ("simulation", simulation::run),
];

fn names() -> clap::builder::PossibleValuesParser {
    STUDIES.map(|(name, _)| name).into()
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let studies = made(args)?;
    let machine = Machine::here();
    let object = object(&machine, &studies);
    let text = document(&machine, &studies);
    if args.json {
        print(&object.to_string())?
    } else {
        print(&text)?
    }
    if let Some(folder) = &args.plot {
        plot(folder, &studies)?;
    }
    if args.quick || args.only.is_some() {
        return Ok(());
    }
    save(&Path::new(DOCUMENTS).join("accuracy.md"), &text)?;
    plot(Path::new(DOCUMENTS), &studies)?;
    keep(&format!("accuracy-{}", slug(&machine.cpu)), &object, args.json)
}

fn made(args: &Args) -> Result<Vec<Study>, Failure> {
    let wanted = |name: &str| args.only.as_deref().is_none_or(|only| only == name);
    let bar = progress(STUDIES.len(), "studies");
    let chosen = STUDIES.iter().filter(|(name, _)| wanted(name));
    let studies = chosen.map(|(_, run)| run(args.quick).inspect(|_| bar.inc(1))).collect();
    bar.finish_and_clear();
    studies
}

fn plot(folder: &Path, studies: &[Study]) -> Result<(), Failure> {
    let made = std::fs::create_dir_all(folder);
    made.map_err(|error| Failure::Input(format!("{}: {error}", folder.display())))?;
    for chart in studies.iter().map(Study::chart) {
        chart.write(&folder.join(format!("{}.svg", chart.name)))?;
    }
    Ok(())
}

fn object(machine: &Machine, studies: &[Study]) -> Value {
    let named: Map<String, Value> =
        studies.iter().map(|study| (study.name.to_owned(), study.object())).collect();
    json!({ "day": machine.day, "machine": machine.object(), "studies": named })
}

fn document(machine: &Machine, studies: &[Study]) -> String {
    let parts: String = studies.iter().map(|study| format!("\n{}", study.markdown())).collect();
    let head = "# `pbig accuracy`\n\nRun time against error. Written by that command, nothing by hand.";
    let zero = "In the charts both axes are logarithmic; what is never wrong lies on the line below, at 0.";
    format!("{head} {}.\n{zero}\n{parts}", machine.line())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_has_the_machine_and_every_study() {
        let machine = Machine::here();
        let text = document(&machine, &[study::tests::small()]);
        for part in ["threads", "## a small study", "- a note\n"] {
            assert!(text.contains(part), "{part} is not in:\n{text}");
        }
        let object = object(&machine, &[study::tests::small()]);
        assert_eq!(object["studies"]["small"]["points"][1]["error"], 0.0);
    }

    #[test]
    fn charts_are_written_into_a_folder_that_is_made_for_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("charts");
        plot(&inner, &[study::tests::small()]).expect("written");
        let text = std::fs::read_to_string(inner.join("accuracy-small.svg")).expect("a chart");
        assert!(text.contains("a small study"));
    }
}
