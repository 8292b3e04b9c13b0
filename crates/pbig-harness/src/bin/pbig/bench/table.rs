//! One row for each measurement, with what it should have been, and three ways to print it.

use super::measure::Took;
use serde_json::{Map, Value, json};

/// The unit of a printed row. Times are kept in milliseconds, memory in MB, and some are plain counts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unit {
    Ms,
    Us,
    Ns,
    Mb,
    Requests,
}

impl Unit {
    fn text(self, value: f64) -> String {
        let (value, name) = match self {
            Self::Requests => return format!("{value:.0}"),
            Self::Ms => (value, "ms"),
            Self::Us => (value * 1e3, "us"),
            Self::Ns => (value * 1e6, "ns"),
            Self::Mb => (value, "MB"),
        };
        // Four digits tell more than any two runs have in common.
        let digits = (3 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 4) as usize;
        format!("{value:.digits$} {name}")
    }

    fn key(self) -> &'static str {
        match self {
            Self::Mb => "mb",
            Self::Requests => "requests",
            _ => "ms",
        }
    }
}

/// The target of a row.
#[derive(Clone, Copy)]
pub(crate) enum Target {
    /// So many times faster than the other.
    Faster(f64),
    /// At most so many times as much as the other.
    Within(f64),
    /// At most this, in the row's own ms or MB.
    Below(f64),
    /// Not one.
    Nothing,
}

/// One measurement.
pub(crate) struct Row {
    pub(crate) case: String,
    pub(crate) boxes: usize,
    pub(crate) pairs: u64,
    ours: Option<f64>,
    other: Option<(&'static str, f64)>,
    target: Option<Target>,
    unit: Unit,
    stages: Vec<(&'static str, f64)>,
    /// Beside ours where that is a median.
    mean: Option<f64>,
    note: Option<String>,
}

impl Row {
    pub(crate) fn new(case: impl Into<String>, boxes: usize, pairs: u64) -> Self {
        let case = case.into();
        let (ours, other, target, mean, note) = (None, None, None, None, None);
        Self { case, boxes, pairs, ours, other, target, unit: Unit::Ms, stages: vec![], mean, note }
    }

    pub(crate) fn ours(self, value: f64) -> Self {
        Self { ours: Some(value), ..self }
    }

    pub(crate) fn against(self, name: &'static str, value: f64) -> Self {
        Self { other: Some((name, value.max(1e-9))), ..self }
    }

    /// Median against median; what the means say is noted.
    pub(crate) fn compare(self, ours: Took, name: &'static str, other: Took) -> Self {
        let text = |ms: f64| self.unit.text(ms);
        let note =
            format!("means {} and {}, {:.2}x", text(ours.mean), text(other.mean), other.mean / ours.mean);
        self.ours(ours.median).against(name, other.median).note(note)
    }

    pub(crate) fn unit(self, unit: Unit) -> Self {
        Self { unit, ..self }
    }

    pub(crate) fn target(self, target: Option<Target>) -> Self {
        Self { target, ..self }
    }

    pub(crate) fn stages(self, stages: Vec<(&'static str, f64)>) -> Self {
        Self { stages, ..self }
    }

    pub(crate) fn mean(self, value: f64) -> Self {
        Self { mean: Some(value), ..self }
    }

    pub(crate) fn note(self, note: impl Into<String>) -> Self {
        Self { note: Some(note.into()), ..self }
    }

    /// Returns the ratio of the other to ours.
    pub(crate) fn ratio(&self) -> Option<f64> {
        // No clock means 0.
        Some(self.other?.1 / self.ours?.max(1e-9))
    }

    /// Returns the cost of ours for each box and each pair.
    pub(crate) fn cost(&self) -> Option<f64> {
        Some(self.ours? / (self.boxes as u64 + self.pairs).max(1) as f64)
    }

    /// By which factor the target is missed; at most 1 when it is met.
    fn missed_by(&self) -> Option<f64> {
        match self.target? {
            Target::Faster(times) => Some(times / self.ratio()?),
            Target::Within(times) => Some(1.0 / (times * self.ratio()?)),
            Target::Below(limit) => Some(self.ours? / limit),
            // One is as bad as another, and more are worse.
            Target::Nothing => self.ours.map(|count| if count < 1.0 { 0.0 } else { 1.0 + count }),
        }
    }

    pub(crate) fn met(&self) -> Option<bool> {
        self.missed_by().map(|factor| factor <= 1.0)
    }

    fn target_text(&self) -> String {
        match self.target {
            Some(Target::Faster(times)) => format!("at least {times}x"),
            Some(Target::Within(times)) => format!("within {times}x"),
            Some(Target::Below(limit)) => format!("under {}", self.unit.text(limit)),
            Some(Target::Nothing) => "none".into(),
            None => String::new(),
        }
    }

    fn verdict(&self) -> String {
        match self.missed_by() {
            Some(factor) if factor <= 1.0 => "met".into(),
            Some(_) if matches!(self.target, Some(Target::Nothing)) => "missed".into(),
            Some(factor) => format!("missed, {factor:.2}x off"),
            None => String::new(),
        }
    }

    fn rest(&self) -> String {
        let mean = self.mean.map(|mean| format!("mean {}", self.unit.text(mean)));
        let stages = self.stages.iter().map(|(name, time)| format!("{name} {}", Unit::Ms.text(*time)));
        mean.into_iter().chain(stages).chain(self.note.clone()).collect::<Vec<_>>().join(", ")
    }

    fn cells(&self) -> [String; 9] {
        let value = |value: Option<f64>| value.map_or("not measured".into(), |value| self.unit.text(value));
        [
            self.case.clone(),
            self.boxes.to_string(),
            self.pairs.to_string(),
            value(self.ours),
            self.other.map_or(String::new(), |(name, time)| format!("{name} {}", self.unit.text(time))),
            self.ratio().map_or(String::new(), |ratio| format!("{ratio:.2}")),
            self.target_text(),
            self.verdict(),
            self.rest(),
        ]
    }

    pub(crate) fn object(&self) -> Value {
        let key = |side: &str| format!("{side}_{}", self.unit.key());
        let target = self.target.map(|_| self.target_text());
        let stages: Map<String, Value> =
            self.stages.iter().map(|(name, time)| ((*name).to_owned(), json!(time))).collect();
        json!({
            "case": self.case, "boxes": self.boxes, "pairs": self.pairs,
            key("ours"): self.ours, "mean_ms": self.mean,
            "other": self.other.map(|(name, _)| name), key("other"): self.other.map(|(_, value)| value),
            "ratio": self.ratio(), "target": target, "met": self.met(), "missed_by": self.missed_by(),
            "stages_ms": stages, "note": self.note,
        })
    }
}

const HEAD: [&str; 9] = ["case", "boxes", "pairs", "ours", "other", "x", "target", "verdict", ""];

/// Columns as wide as they need to be; numbers to the right.
pub(crate) fn text(rows: &[Row]) -> String {
    let lines: Vec<[String; 9]> =
        std::iter::once(HEAD.map(str::to_owned)).chain(rows.iter().map(Row::cells)).collect();
    let width: [usize; 9] =
        std::array::from_fn(|k| lines.iter().map(|line| line[k].chars().count()).max().unwrap_or(0));
    let line = |cells: &[String; 9]| {
        let padded = cells.iter().zip(width).enumerate().map(|(k, (cell, width))| match k {
            1..=3 | 5 => format!("{cell:>width$}"),
            _ => format!("{cell:<width$}"),
        });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    lines.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Returns the rows as a table for a document.
pub(crate) fn markdown(rows: &[Row]) -> String {
    let line = |cells: [String; 9]| format!("| {} |\n", cells.join(" | "));
    let rule = HEAD.map(|_| "---".to_owned());
    let all = [HEAD.map(str::to_owned), rule].into_iter().chain(rows.iter().map(Row::cells));
    all.map(line).collect()
}

/// Returns the number of targets, the number of targets that are met, and the row that is worst for us.
pub(crate) fn summary(rows: &[Row]) -> Vec<String> {
    let judged: Vec<&Row> = rows.iter().filter(|row| row.met().is_some()).collect();
    let met = judged.iter().filter(|row| row.met() == Some(true)).count();
    let off = |row: &Row| row.missed_by().unwrap_or(0.0);
    let worst = judged.iter().max_by(|a, b| off(a).total_cmp(&off(b)));
    let worst = worst
        .map(|row| format!("furthest from its target: {}, {} boxes, {}", row.case, row.boxes, row.verdict()));
    let count = (!judged.is_empty()).then(|| format!("{met} of {} targets met", judged.len()));
    count.into_iter().chain(worst).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_says_by_how_much_a_target_is_missed() {
        let row = |target| Row::new("case", 10, 3).ours(2.0).against("other", 6.0).target(Some(target));
        assert_eq!(row(Target::Faster(3.0)).verdict(), "met");
        assert_eq!(row(Target::Faster(4.5)).verdict(), "missed, 1.50x off");
        assert_eq!(row(Target::Within(0.25)).verdict(), "missed, 1.33x off");
        assert_eq!(row(Target::Below(1.0)).verdict(), "missed, 2.00x off");
        assert_eq!(row(Target::Below(2.0)).target_text(), "under 2.000 ms");
        assert_eq!(Row::new("case", 1, 0).target(Some(Target::Below(1.0))).met(), None, "nothing measured");
    }

    #[test]
    fn a_comparison_is_of_medians_and_notes_the_means() {
        let (ours, other) = (Took { median: 1.0, mean: 2.0 }, Took { median: 3.0, mean: 5.0 });
        let row = Row::new("case", 10, 3).compare(ours, "other", other);
        assert_eq!((row.ratio(), row.rest().as_str()), (Some(3.0), "means 2.000 ms and 5.000 ms, 2.50x"));
    }

    #[test]
    fn a_table_has_a_line_for_each_row_and_aligned_columns() {
        let rows = [Row::new("a", 10, 3).ours(2.0), Row::new("longer", 1, 300).ours(0.5).unit(Unit::Us)];
        let lines: Vec<String> = text(&rows).lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[1].find("2.000 ms"), lines[2].find("500.0 us"));
        assert_eq!(markdown(&rows).lines().count(), 4);
    }
}
