//! The time of `pbig bench papers` itself, which is promised to be short.

use crate::bench::measure::MOST_SECONDS;
use serde_json::{Value, json};
use std::time::Duration;

/// Wall time of a run, part by part.
pub(super) struct Timing {
    parts: Vec<(&'static str, f64)>,
    most_seconds: f64,
    /// The time with `--quick`, which writes no document of its own.
    with_quick: Option<Result<f64, String>>,
}

impl Timing {
    pub(super) fn new(quick: bool) -> Self {
        Self { parts: vec![], most_seconds: MOST_SECONDS[usize::from(quick)], with_quick: None }
    }

    pub(super) fn note(&mut self, name: &'static str, took: Duration) {
        self.parts.push((name, took.as_secs_f64()));
    }

    /// The seconds of that run, or its error.
    pub(super) fn note_quick(&mut self, quick: Result<f64, String>) {
        self.with_quick = Some(quick);
    }

    pub(super) fn seconds_quick(&self) -> Option<f64> {
        self.with_quick.as_ref().and_then(|quick| quick.as_ref().ok()).copied()
    }

    pub(super) fn seconds(&self) -> f64 {
        self.parts.iter().map(|(_, seconds)| seconds).sum()
    }

    pub(super) fn most_seconds(&self) -> f64 {
        self.most_seconds
    }

    pub(super) fn is_met(&self) -> bool {
        self.seconds() < self.most_seconds
    }

    pub(super) fn object(&self) -> Value {
        self.parts.iter().map(|(name, seconds)| json!({ "name": name, "seconds": seconds })).collect()
    }

    pub(super) fn text(&self) -> String {
        let parts: Vec<String> =
            self.parts.iter().map(|(name, seconds)| format!("{name} {seconds:.1} s")).collect();
        let took = told(self.seconds(), self.most_seconds);
        let quick = match &self.with_quick {
            None => String::new(),
            Some(Ok(seconds)) => {
                format!(" With `--quick` the same took {}.", told(*seconds, MOST_SECONDS[1]))
            }
            Some(Err(error)) => format!(" With `--quick` the same failed: {error}."),
        };
        format!("The run took {took}. Of that: {}.{quick}", parts.join("; "))
    }
}

fn told(seconds: f64, most: f64) -> String {
    let verdict = if seconds < most { "met" } else { "missed" };
    format!("{seconds:.1} s; wanted on two cores: under {most} s ({verdict})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_are_held_against_what_is_promised() {
        let mut timing = Timing::new(true);
        timing.note("one", Duration::from_secs(30));
        assert_eq!(
            timing.text(),
            "The run took 30.0 s; wanted on two cores: under 60 s (met). Of that: one 30.0 s."
        );
        let mut full = Timing::new(false);
        full.note_quick(Ok(timing.seconds()));
        assert!(
            full.text()
                .ends_with("With `--quick` the same took 30.0 s; wanted on two cores: under 60 s (met).")
        );
        full.note_quick(Err("a pair is missing".into()));
        assert!(full.text().ends_with("With `--quick` the same failed: a pair is missing."));
        assert_eq!(full.seconds_quick(), None);
        timing.note("other", Duration::from_secs(45));
        assert_eq!((timing.seconds(), timing.is_met()), (75.0, false));
        assert!(timing.text().contains("(missed)"), "{}", timing.text());
    }
}
