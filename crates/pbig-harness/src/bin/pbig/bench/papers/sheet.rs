//! A table of its own columns, with what it says in words and its charts, and three ways to print it.

use pbig_harness::chart::LogLog;
use serde_json::{Map, Value, json};

/// One table or figure of a paper, reproduced.
pub(super) struct Sheet {
    title: String,
    /// Sentences above the table.
    about: Vec<String>,
    columns: Vec<String>,
    /// Numbers stay numbers; null is an empty field.
    rows: Vec<Vec<Value>>,
    pub(super) charts: Vec<LogLog>,
}

impl Sheet {
    pub(super) fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|&column| column.to_owned()).collect();
        Self { title: title.into(), about: vec![], columns, rows: vec![], charts: vec![] }
    }

    pub(super) fn about(mut self, sentence: impl Into<String>) -> Self {
        self.about.push(sentence.into());
        self
    }

    pub(super) fn chart(mut self, chart: LogLog) -> Self {
        self.charts.push(chart);
        self
    }

    /// A row: a JSON array with a field for each column.
    pub(super) fn row(&mut self, fields: Value) {
        let Value::Array(fields) = fields else { unreachable!("rows are arrays") };
        debug_assert_eq!(fields.len(), self.columns.len(), "{}", self.title);
        self.rows.push(fields);
    }

    pub(super) fn object(&self) -> Value {
        let named = |row: &Vec<Value>| -> Value {
            self.columns.iter().cloned().zip(row.iter().cloned()).collect::<Map<_, _>>().into()
        };
        let rows: Vec<Value> = self.rows.iter().map(named).collect();
        json!({ "title": self.title, "about": self.about, "rows": rows })
    }

    pub(super) fn markdown(&self) -> String {
        let about: String = self.about.iter().map(|sentence| format!("- {sentence}\n")).collect();
        let line = |fields: Vec<String>| format!("| {} |\n", fields.join(" | "));
        let rule = vec!["---".to_owned(); self.columns.len()];
        let table: String = [self.columns.clone(), rule].into_iter().chain(self.texts()).map(line).collect();
        let chart = |chart: &LogLog| format!("\n![{}]({}.svg)\n", chart.title, chart.name);
        let charts: String = self.charts.iter().map(chart).collect();
        format!("## {}\n\n{about}\n{table}{charts}", self.title)
    }

    /// For a terminal: columns as wide as they need to be.
    pub(super) fn text(&self) -> String {
        let lines: Vec<Vec<String>> = std::iter::once(self.columns.clone()).chain(self.texts()).collect();
        let width = |k: usize| lines.iter().map(|line| line[k].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let line = |line: &Vec<String>| {
            let padded = line.iter().zip(&widths).map(|(field, width)| format!("{field:<width$}"));
            padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        let table: Vec<String> = lines.iter().map(line).collect();
        format!("{}\n{}\n{}\n", self.title, self.about.join("\n"), table.join("\n"))
    }

    fn texts(&self) -> impl Iterator<Item = Vec<String>> {
        self.rows.iter().map(|row| row.iter().map(text).collect())
    }
}

/// A field as a reader wants it.
fn text(field: &Value) -> String {
    match field {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Number(number) => match number.as_u64() {
            Some(whole) => thousands(whole),
            None => number.as_f64().map_or(String::new(), short),
        },
        other => other.to_string(),
    }
}

/// Whole numbers with a comma at each third digit.
pub(super) fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let comma = |i: usize| i > 0 && (digits.len() - i).is_multiple_of(3);
    digits.char_indices().flat_map(|(i, digit)| [comma(i).then_some(','), Some(digit)]).flatten().collect()
}

/// Four digits, which is more than any two runs have in common.
pub(super) fn short(number: f64) -> String {
    if !number.is_finite() {
        return "none".to_owned();
    }
    if number.abs() >= 1e4 {
        let sign = if number < 0.0 { "-" } else { "" };
        return format!("{sign}{}", thousands(number.abs().round() as u64));
    }
    let digits = (3 - number.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize;
    format!("{number:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_has_a_line_for_each_row_in_every_form() {
        let mut sheet = Sheet::new("a table", &["boxes", "ms"]).about("a sentence");
        sheet.row(json!([10_000_000, 1.25]));
        sheet.row(json!([null, "not run"]));
        assert!(sheet.markdown().contains(
            "- a sentence\n\n| boxes | ms |\n| --- | --- |\n| 10,000,000 | 1.250 |\n|  | not run |"
        ));
        assert_eq!(sheet.text().lines().count(), 5);
        assert_eq!(sheet.object()["rows"][0]["boxes"], 10_000_000);
    }

    #[test]
    fn numbers_are_short_and_whole_ones_have_commas() {
        assert_eq!([999, 1000, 1_234_567].map(thousands), ["999", "1,000", "1,234,567"]);
        assert_eq!([0.001_234_5, 12.3456, -20_000.4].map(short), ["0.001234", "12.35", "-20,000"]);
    }
}
