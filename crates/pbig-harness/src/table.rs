//! The one kind of table: named columns of values.

use crate::chart::Line;
use serde_json::Map;

/// A label, a number, or nothing where nothing was measured.
pub use serde_json::Value;

/// Makes a row from values of different types; `..values` appends several, and `()` an empty cell.
#[macro_export]
macro_rules! cells {
    (@ $row:ident) => {};
    (@ $row:ident ..$values:expr $(, $($rest:tt)*)?) => {
        $row.extend($values.into_iter().map($crate::table::Value::from));
        $($crate::cells!(@ $row $($rest)*);)?
    };
    (@ $row:ident $value:expr $(, $($rest:tt)*)?) => { $crate::cells!(@ $row ..[$value] $(, $($rest)*)?) };
    ($($values:tt)*) => {{ let mut row = vec![]; $crate::cells!(@ row $($values)*); row }};
}

/// Returns a value as files have it: a number with up to nine digits.
pub fn text(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => {
            let digits = format!("{:.8e}", value.as_f64().unwrap_or_default());
            digits.parse().map_or(digits, |number: f64| number.to_string())
        }
        other => other.to_string(),
    }
}

/// Returns a value as a terminal shows it: a number with four digits.
fn short(value: &Value) -> String {
    match value.as_f64() {
        Some(number) if value.is_f64() && number != 0.0 => {
            let digits = (3 - number.abs().log10().floor() as i32).clamp(0, 9) as usize;
            format!("{number:.digits$}")
        }
        _ => text(value),
    }
}

/// Rows under named columns. The first columns name the row; units are in the columns' names. A column that does not exist is a
/// panic, and so is a row with too many values.
#[derive(Clone, Debug)]
pub struct Table {
    pub name: String,
    pub columns: Vec<String>,
    /// The rows, each with a value for each column.
    pub rows: Vec<Vec<Value>>,
}

impl Table {
    /// Makes a table without rows. Columns are separated by `|`.
    pub fn new(name: &str, columns: &str) -> Self {
        let columns = columns.split('|').map(|column| column.trim().to_owned()).collect();
        Self { name: name.into(), columns, rows: vec![] }
    }

    /// Appends a row. Values that are missing at its end were not measured.
    pub fn row(&mut self, values: impl IntoIterator<Item = Value>) {
        let mut values: Vec<Value> = values.into_iter().collect();
        assert!(values.len() <= self.columns.len(), "{}: too many values: {values:?}", self.name);
        values.resize(self.columns.len(), Value::Null);
        self.rows.push(values);
    }

    fn place(&self, column: &str) -> usize {
        let place = self.columns.iter().position(|name| name == column);
        place.unwrap_or_else(|| panic!("{} has no column {column}", self.name))
    }

    pub fn column(&self, name: &str) -> impl Iterator<Item = &Value> {
        let place = self.place(name);
        self.rows.iter().map(move |row| &row[place])
    }

    pub fn numbers(&self, name: &str) -> Vec<f64> {
        self.column(name).filter_map(Value::as_f64).collect()
    }

    /// Returns the number in a column of a row of this table.
    pub fn number(&self, row: &[Value], column: &str) -> Option<f64> {
        row[self.place(column)].as_f64()
    }

    /// Returns a line of a chart: a column against another one, in the rows that are wanted and have numbers in both.
    pub fn line(&self, name: &str, [x, y]: [&str; 2], is_wanted: impl Fn(&[Value]) -> bool) -> Line {
        let wanted = self.rows.iter().filter(|row| is_wanted(row));
        let points = wanted.filter_map(|row| Some((self.number(row, x)?, self.number(row, y)?))).collect();
        Line { name: name.into(), points }
    }

    /// Returns the rows as a CSV file below their heading.
    pub fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(vec![]);
        writer.write_record(&self.columns).expect("memory takes it all");
        for row in &self.rows {
            writer.write_record(row.iter().map(text)).expect("memory takes it all");
        }
        String::from_utf8_lossy(&writer.into_inner().expect("memory takes it all")).into_owned()
    }

    /// Returns the table's name in lower case, with `-` for what is neither a letter nor a digit.
    pub fn file_name(&self) -> String {
        let plain = self.name.to_lowercase();
        let words =
            plain.split(|letter: char| !letter.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-")
    }

    pub fn object(&self) -> Value {
        let row = |row: &Vec<Value>| -> Value {
            self.columns.iter().cloned().zip(row.iter().cloned()).collect::<Map<_, _>>().into()
        };
        self.rows.iter().map(row).collect()
    }

    /// Returns the table for a terminal.
    pub fn show(&self) -> String {
        let mut table = comfy_table::Table::new();
        table.load_preset(comfy_table::presets::ASCII_MARKDOWN).set_header(&self.columns);
        for row in &self.rows {
            table.add_row(row.iter().map(short));
        }
        for (k, column) in table.column_iter_mut().enumerate() {
            if self.rows.iter().any(|row| row[k].is_number()) {
                column.set_cell_alignment(comfy_table::CellAlignment::Right);
            }
        }
        format!("{}\n{table}\n", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_nine_digits_in_a_file_and_four_on_a_terminal() {
        let mut table = Table::new("Some table: of sets", "set | boxes | ms");
        table.row(cells!["unit", 10usize, 2.0 / 3.0]);
        table.row(cells!["a, b", 100u64, None::<f64>]);
        table.row(cells!["tiny", 1, 1e-7f64]);
        let rows = "unit,10,0.666666667\n\"a, b\",100,\ntiny,1,0.0000001\n";
        assert_eq!(table.csv(), format!("set,boxes,ms\n{rows}"));
        assert!(table.show().contains("| unit |    10 |      0.6667 |"), "{}", table.show());
        assert_eq!(table.object()[1], serde_json::json!({ "set": "a, b", "boxes": 100, "ms": null }));
        assert_eq!((table.numbers("boxes").len(), table.numbers("ms").len()), (3, 2));
        assert_eq!(table.file_name(), "some-table-of-sets");
    }
}
