//! The results of a study: tables of typed values, notes for the reader, and points of time against error.

use pbig_harness::chart::{Line, Pareto};
use serde_json::{Map, Value, json};

/// One value in a table.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Text(String),
    Count(u64),
    Number(f64),
    /// Not measured, or without meaning here.
    Nothing,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Nothing, Into::into)
    }
}

impl Cell {
    pub(super) fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number) => plain(*number),
            Self::Nothing => "-".into(),
        }
    }

    fn value(&self) -> Value {
        match self {
            Self::Text(text) => json!(text),
            Self::Count(count) => json!(count),
            Self::Number(number) => json!(number),
            Self::Nothing => Value::Null,
        }
    }
}

/// Four digits, with a power of ten where zeros would hide them.
pub(super) fn plain(number: f64) -> String {
    let size = number.abs();
    if !size.is_finite() || size == 0.0 {
        return format!("{number}");
    }
    if !(1e-3..1e7).contains(&size) {
        return format!("{number:.2e}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
    format!("{number:.digits$}")
}

/// A time in minutes and seconds; below a minute with a digit behind the point.
pub(super) fn clock(seconds: f64) -> String {
    // What rounds to 60 is a minute.
    if seconds < 59.95 {
        return format!("{seconds:.1} s");
    }
    let whole = seconds.round() as u64;
    format!("{} min {} s", whole / 60, whole % 60)
}

/// Rows under named columns. A column's name is its key in the JSON; people read it with spaces.
pub(super) struct Table {
    /// Its key in the JSON.
    pub(super) name: &'static str,
    /// Above the table.
    pub(super) title: String,
    /// Words joined by `_`, the unit last: `wrong_percent`, `ns_per_pair`.
    pub(super) columns: Vec<&'static str>,
    /// Each with as many cells as there are columns.
    pub(super) rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(super) fn new(name: &'static str, title: impl Into<String>, columns: &[&'static str]) -> Self {
        Self { name, title: title.into(), columns: columns.to_vec(), rows: vec![] }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    fn markdown(&self) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let head = self.columns.iter().map(|column| column.replace('_', " ")).collect();
        let rule = self.columns.iter().map(|_| "---".to_owned()).collect();
        let rows = self.rows.iter().map(|row| row.iter().map(Cell::text).collect());
        let all: String = [head, rule].into_iter().chain(rows).map(line).collect();
        format!("### {}\n\n{all}", self.title)
    }

    fn object(&self) -> Value {
        let row = |row: &Vec<Cell>| -> Value {
            let named = self.columns.iter().zip(row);
            named.map(|(column, cell)| ((*column).to_owned(), cell.value())).collect::<Map<_, _>>().into()
        };
        json!({ "title": self.title, "rows": self.rows.iter().map(row).collect::<Vec<_>>() })
    }
}

/// The cost of something, and its error.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    /// Points of one series have one colour, and may be joined in the order given.
    pub(super) series: String,
    /// In the unit of the study's axis of time.
    pub(super) time: f64,
    /// In the unit of the study's axis of errors; 0 where nothing is wrong.
    pub(super) error: f64,
}

/// One study.
pub(super) struct Study {
    /// Its key in the JSON, and a part of the name of its chart.
    pub(super) name: &'static str,
    /// Above its part of the document, and above the chart.
    pub(super) title: &'static str,
    /// Notes for the reader and findings, a line each.
    pub(super) notes: Vec<String>,
    pub(super) tables: Vec<Table>,
    /// The chart's axes, with their units.
    pub(super) time: &'static str,
    pub(super) error: &'static str,
    pub(super) points: Vec<Point>,
    /// True if the points of a series are joined, because their order means something.
    pub(super) joined: bool,
}

impl Study {
    /// Time against error. Series are drawn in the order in which they first appear.
    pub(super) fn chart(&self) -> Pareto {
        let mut lines: Vec<Line> = Vec::new();
        for Point { series, time, error } in &self.points {
            match lines.iter_mut().find(|line| line.name == *series) {
                Some(line) => line.points.push((*time, *error)),
                None => lines.push(Line { name: series.clone(), points: vec![(*time, *error)] }),
            }
        }
        let (name, title) = (format!("accuracy-{}", self.name), self.title.to_owned());
        Pareto { name, title, x: self.time, y: self.error, lines, joined: self.joined }
    }

    /// Its part of the document, and how long it took.
    pub(super) fn markdown(&self, seconds: f64) -> String {
        let notes: String = self.notes.iter().map(|note| format!("- {note}\n")).collect();
        let tables: String = self.tables.iter().map(|table| format!("\n{}", table.markdown())).collect();
        let chart = self.chart();
        let head = format!("## {}\n\nTook {}.\n\n{notes}", self.title, clock(seconds));
        format!("{head}\n![{}]({}.svg)\n{tables}", chart.title, chart.name)
    }

    pub(super) fn object(&self) -> Value {
        let tables: Map<String, Value> =
            self.tables.iter().map(|table| (table.name.to_owned(), table.object())).collect();
        let point = |p: &Point| json!({ "series": p.series, "time": p.time, "error": p.error });
        json!({
            "title": self.title, "notes": self.notes, "tables": tables,
            "time": self.time, "error": self.error,
            "points": self.points.iter().map(point).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A study with one of everything.
    pub(in super::super) fn small() -> Study {
        let mut table = Table::new("some", "some table", &["case", "boxes", "ns_per_pair", "missed"]);
        table.row(["a".into(), 3u64.into(), 0.25.into(), Cell::Nothing]);
        let point = |series: &str, time, error| Point { series: series.into(), time, error };
        Study {
            name: "small",
            title: "a small study",
            notes: vec!["a note".into()],
            tables: vec![table],
            time: "ns",
            error: "wrong, %",
            points: vec![point("one", 1.0, 0.5), point("two", 2.0, 0.0), point("one", 3.0, 0.1)],
            joined: true,
        }
    }

    #[test]
    fn a_study_is_the_same_in_the_document_and_in_json() {
        let text = small().markdown(1.0);
        for part in ["## a small study", "- a note\n", "](accuracy-small.svg)", "| a | 3 | 0.2500 | - |"] {
            assert!(text.contains(part), "{part} is not in:\n{text}");
        }
        assert!(text.contains("| case | boxes | ns per pair | missed |"), "{text}");
        let row = &small().object()["tables"]["some"]["rows"][0];
        assert_eq!(*row, json!({ "case": "a", "boxes": 3, "ns_per_pair": 0.25, "missed": null }));
    }

    #[test]
    fn points_of_a_series_are_one_line() {
        let lines = small().chart().lines;
        assert_eq!(lines.iter().map(|line| line.name.as_str()).collect::<Vec<_>>(), ["one", "two"]);
        assert_eq!(lines[0].points, [(1.0, 0.5), (3.0, 0.1)]);
    }

    #[test]
    fn a_time_is_told_in_minutes_and_seconds() {
        assert_eq!([0.04, 9.95, 59.96, 432.4].map(clock), ["0.0 s", "9.9 s", "1 min 0 s", "7 min 12 s"]);
    }

    #[test]
    fn numbers_keep_four_digits() {
        let texts = [0.0, 12.3456, 123_456.7, 0.25, 0.000_012_34, 1e9, f64::INFINITY].map(plain);
        assert_eq!(texts, ["0", "12.35", "123457", "0.2500", "1.23e-5", "1.00e9", "inf"]);
    }
}
