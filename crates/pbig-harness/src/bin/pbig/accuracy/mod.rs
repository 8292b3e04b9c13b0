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
use crate::bench::measure::MOST_SECONDS;
use crate::bench::{DOCUMENTS, keep, save};
use crate::output::{Failure, print, progress};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;
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
    let clock = Instant::now();
    let studies = made(args)?;
    let seconds = clock.elapsed().as_secs_f64();
    let is_kept = !args.quick && args.only.is_none();
    let quick = is_kept.then(quick_seconds).transpose();
    let with_quick = told_quick(&quick);
    let (machine, took) = (Machine::here(), Took { seconds, is_quick: args.quick, with_quick });
    let object = object(&machine, &took, &studies);
    let text = document(&machine, &took, &studies);
    if args.json {
        print(&object.to_string())?
    } else {
        print(&text)?
    }
    if let Some(folder) = &args.plot {
        plot(folder, &studies)?;
    }
    if !is_kept {
        return Ok(());
    }
    save(&Path::new(DOCUMENTS).join("accuracy.md"), &text)?;
    plot(Path::new(DOCUMENTS), &studies)?;
    keep(&format!("accuracy-{}", slug(&machine.cpu)), &object, args.json)?;
    quick.map(|_| ())
}

/// An error of the quick run is told with the results of the one that is done, not instead of them.
fn told_quick(quick: &Result<Option<f64>, Failure>) -> Option<Result<f64, String>> {
    quick.as_ref().map_err(Failure::to_string).copied().transpose()
}

/// The time of a run, and the time of the same run with `--quick`, if it is reported.
struct Took {
    seconds: f64,
    is_quick: bool,
    with_quick: Option<Result<f64, String>>,
}

impl Took {
    /// Returns the promised maximum of the run, in seconds.
    fn most_seconds(&self) -> f64 {
        MOST_SECONDS[usize::from(self.is_quick)]
    }

    fn is_met(&self) -> bool {
        self.seconds < self.most_seconds()
    }

    fn quick(&self) -> String {
        let told = |seconds: f64| Self { seconds, is_quick: true, with_quick: None }.told();
        match &self.with_quick {
            None => String::new(),
            Some(Ok(seconds)) => format!("\nWith `--quick` the same took {}.", told(*seconds)),
            Some(Err(error)) => format!("\nWith `--quick` the same failed: {error}."),
        }
    }

    fn told(&self) -> String {
        let verdict = if self.is_met() { "met" } else { "missed" };
        let most = study::clock(self.most_seconds());
        let taken = study::clock(self.seconds);
        format!("{taken} from end to end; wanted on two cores: under {most} ({verdict})")
    }
}

/// Returns the time of all studies with `--quick`. A full run reports it, because a quick one writes no document.
fn quick_seconds() -> Result<f64, Failure> {
    let clock = Instant::now();
    STUDIES.iter().try_for_each(|(_, run)| run(true).map(|_| ()))?;
    Ok(clock.elapsed().as_secs_f64())
}

/// A study, and how long it took.
struct Made {
    study: Study,
    seconds: f64,
}

impl Made {
    fn by(run: Run, quick: bool) -> Result<Self, Failure> {
        let clock = Instant::now();
        let study = run(quick)?;
        Ok(Self { study, seconds: clock.elapsed().as_secs_f64() })
    }
}

fn made(args: &Args) -> Result<Vec<Made>, Failure> {
    let wanted = |name: &str| args.only.as_deref().is_none_or(|only| only == name);
    let bar = progress(STUDIES.len(), "studies");
    let chosen = STUDIES.iter().filter(|(name, _)| wanted(name));
    let studies = chosen.map(|(_, run)| Made::by(*run, args.quick).inspect(|_| bar.inc(1))).collect();
    bar.finish_and_clear();
    studies
}

fn plot(folder: &Path, studies: &[Made]) -> Result<(), Failure> {
    let made = std::fs::create_dir_all(folder);
    made.map_err(|error| Failure::Input(format!("{}: {error}", folder.display())))?;
    for chart in studies.iter().map(|made| made.study.chart()) {
        chart.write(&folder.join(format!("{}.svg", chart.name)))?;
    }
    Ok(())
}

fn object(machine: &Machine, took: &Took, studies: &[Made]) -> Value {
    let named = studies.iter().map(|Made { study, seconds }| {
        let mut object = study.object();
        object["seconds"] = json!(seconds);
        (study.name.to_owned(), object)
    });
    let named: Map<String, Value> = named.collect();
    json!({
        "day": machine.day,
        "machine": machine.object(),
        "seconds": took.seconds,
        "seconds_wanted": took.most_seconds(),
        "met": took.is_met(),
        "seconds_quick": took.with_quick.as_ref().and_then(|quick| quick.as_ref().ok()),
        "studies": named,
    })
}

fn document(machine: &Machine, took: &Took, studies: &[Made]) -> String {
    let parts: String =
        studies.iter().map(|made| format!("\n{}", made.study.markdown(made.seconds))).collect();
    let head = "# `pbig accuracy`\n\nRun time against error. Written by that command, nothing by hand.";
    let zero = "In the charts both axes are logarithmic; what is never wrong lies on the line below, at 0.";
    let each = studies.iter().map(|made| format!("{} {}", made.study.name, study::clock(made.seconds)));
    let each = each.collect::<Vec<_>>().join(", ");
    let took = format!("The run took {}. Of that: {each}.{}", took.told(), took.quick());
    format!("{head} {}.\n{took}\n{zero}\n{parts}", machine.line())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> [Made; 1] {
        [Made { study: study::tests::small(), seconds: 9.6 }]
    }

    #[test]
    fn the_document_has_the_machine_every_study_and_how_long_it_took() {
        let machine = Machine::here();
        let full = Took { seconds: 432.1, is_quick: false, with_quick: Some(Ok(33.3)) };
        let text = document(&machine, &full, &small());
        let quick = "With `--quick` the same took 33.3 s from end to end; wanted on two cores: under 1 min 0 s (met).";
        let took = "The run took 7 min 12 s from end to end; wanted on two cores: under 20 min 0 s (met). Of that: small 9.6 s.";
        for part in ["threads", quick, "## a small study\n\nTook 9.6 s.\n\n- a note\n", took] {
            assert!(text.contains(part), "{part} is not in:\n{text}");
        }
        let slow = Took { is_quick: true, with_quick: None, ..full };
        assert!(document(&machine, &slow, &small()).contains("under 1 min 0 s (missed). Of that"));
        assert_eq!(object(&machine, &slow, &small())["met"], false);
        let object = object(&machine, &full, &small());
        assert_eq!((&object["seconds_wanted"], &object["seconds_quick"]), (&json!(1200.0), &json!(33.3)));
        assert_eq!(object["studies"]["small"]["points"][1]["error"], 0.0);
        assert_eq!(
            (&object["seconds"], &object["studies"]["small"]["seconds"]),
            (&json!(432.1), &json!(9.6))
        );
    }

    #[test]
    fn what_fails_with_quick_is_told_with_the_results() {
        let machine = Machine::here();
        let with_quick = told_quick(&Err(Failure::Check("a pair is missing".into())));
        let took = Took { seconds: 432.1, is_quick: false, with_quick };
        let text = document(&machine, &took, &small());
        assert!(text.contains("\nWith `--quick` the same failed: a pair is missing.\n"), "{text}");
        assert!(text.contains("## a small study"));
        assert!(object(&machine, &took, &small())["seconds_quick"].is_null());
        assert_eq!((told_quick(&Ok(None)), told_quick(&Ok(Some(2.0)))), (None, Some(Ok(2.0))));
    }

    #[test]
    fn a_study_is_timed() {
        let made = Made::by(|_| Ok(study::tests::small()), true).expect("no failure");
        assert!(made.study.name == "small" && made.seconds < 1.0);
        assert!(Made::by(|_| Err(Failure::Check("wrong".into())), true).is_err());
    }

    #[test]
    fn charts_are_written_into_a_folder_that_is_made_for_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("charts");
        plot(&inner, &small()).expect("written");
        let text = std::fs::read_to_string(inner.join("accuracy-small.svg")).expect("a chart");
        assert!(text.contains("a small study"));
    }
}
