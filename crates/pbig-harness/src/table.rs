//! The one kind of table: named columns of typed cells.

use crate::chart::Line;
use serde_json::{Map, Value, json};

/// One value in a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A label.
    Text(String),
    /// A whole number.
    Count(u64),
    /// A measured number.
    Number(f64),
    /// Not measured, or without meaning in this row.
    Nothing,
}

macro_rules! from_counts {
    ($($count:ty),*) => {$(impl From<$count> for Cell {
        fn from(count: $count) -> Self {
            Self::Count(count as u64)
        }
    })*};
}
from_counts!(u32, u64, usize);

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<f32> for Cell {
    fn from(number: f32) -> Self {
        Self::Number(number.into())
    }
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

impl From<&String> for Cell {
    fn from(text: &String) -> Self {
        Self::Text(text.clone())
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Nothing, Into::into)
    }
}

/// Makes a row of cells from values of different types.
#[macro_export]
macro_rules! cells {
    ($($value:expr),* $(,)?) => { vec![$($crate::table::Cell::from($value)),*] };
}

impl Cell {
    /// Returns the number, of a cell that has one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Count(count) => Some(*count as f64),
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// Returns the cell as files have it: up to nine digits.
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number) => {
                format!("{number:.8e}").parse().map_or(String::new(), |digits: f64| digits.to_string())
            }
            Self::Nothing => String::new(),
        }
    }

    /// Returns the cell as a terminal shows it: four digits.
    fn short(&self) -> String {
        match self {
            Self::Number(number) if number.is_finite() && *number != 0.0 => {
                let digits = (3 - number.abs().log10().floor() as i32).clamp(0, 9) as usize;
                format!("{number:.digits$}")
            }
            other => other.text(),
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

/// Rows under named columns. The first columns name the row; units are in the columns' names.
#[derive(Clone, Debug)]
pub struct Table {
    /// The name in files and JSON.
    pub name: String,
    /// The names of the columns.
    pub columns: Vec<String>,
    /// The rows, each with a cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// Makes a table without rows.
    pub fn new<C: ToString>(name: &str, columns: impl IntoIterator<Item = C>) -> Self {
        let columns = columns.into_iter().map(|column| column.to_string()).collect();
        Self { name: name.into(), columns, rows: vec![] }
    }

    /// Appends a row.
    ///
    /// # Panics
    /// If the row has not one cell for each column.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        let cells: Vec<Cell> = cells.into_iter().collect();
        assert_eq!(cells.len(), self.columns.len(), "cells of a row of {}", self.name);
        self.rows.push(cells);
    }

    /// Returns the cells of a column.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn column(&self, name: &str) -> impl Iterator<Item = &Cell> {
        let place = self.columns.iter().position(|column| column == name);
        let place = place.unwrap_or_else(|| panic!("{} has no column {name}", self.name));
        self.rows.iter().map(move |row| &row[place])
    }

    /// Returns a line of a chart: a column against another one, in the rows that are wanted and have numbers in both.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn line(&self, name: &str, [x, y]: [&str; 2], is_wanted: impl Fn(&[Cell]) -> bool) -> Line {
        let places = self.rows.iter().zip(self.column(x)).zip(self.column(y));
        let wanted = places.filter(|((row, _), _)| is_wanted(row));
        let points = wanted.filter_map(|((_, x), y)| Some((x.number()?, y.number()?))).collect();
        Line { name: name.into(), points }
    }

    /// Returns how many of the first columns it takes to tell all rows apart.
    fn labels(&self) -> usize {
        let is_enough = |count: &usize| {
            let mut labels: Vec<String> = self.rows.iter().map(|row| label(&row[..*count])).collect();
            labels.sort_unstable();
            labels.windows(2).all(|two| two[0] != two[1])
        };
        (1..self.columns.len()).find(is_enough).unwrap_or(1)
    }

    /// Returns each value with its row and column, as [`LONG`] has them. Empty cells are left out.
    pub fn long(&self) -> Vec<[String; 4]> {
        let labels = self.labels();
        let one = |row: &Vec<Cell>, k: usize| {
            [&self.name, &label(&row[..labels]), &self.columns[k]].map(String::clone)
        };
        let values = self.rows.iter().flat_map(|row| (labels..row.len()).map(move |k| (row, k)));
        let values = values.filter(|(row, k)| row[*k] != Cell::Nothing);
        values
            .map(|(row, k)| {
                let [table, name, column] = one(row, k);
                [table, name, column, row[k].text()]
            })
            .collect()
    }

    /// Returns the rows as objects.
    pub fn object(&self) -> Value {
        let row = |row: &Vec<Cell>| -> Value {
            let named = self.columns.iter().zip(row).map(|(column, cell)| (column.clone(), cell.value()));
            named.collect::<Map<_, _>>().into()
        };
        self.rows.iter().map(row).collect()
    }

    /// Returns the table for a terminal.
    pub fn show(&self) -> String {
        let mut table = comfy_table::Table::new();
        table.load_preset(comfy_table::presets::ASCII_MARKDOWN).set_header(&self.columns);
        for row in &self.rows {
            table.add_row(row.iter().map(Cell::short));
        }
        let is_number = |k: usize| self.rows.iter().any(|row| row[k].number().is_some());
        for (k, column) in table.column_iter_mut().enumerate().filter(|(k, _)| is_number(*k)) {
            _ = (k, column.set_cell_alignment(comfy_table::CellAlignment::Right));
        }
        format!("{}\n{table}\n", self.name)
    }
}

/// The columns of a file with several tables.
pub const LONG: [&str; 4] = ["table", "row", "column", "value"];

fn label(cells: &[Cell]) -> String {
    cells.iter().map(Cell::text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("some", ["set", "boxes", "ms"]);
        table.row(cells!["unit", 10usize, 2.0 / 3.0]);
        table.row(cells!["unit", 100u64, None::<f64>]);
        table
    }

    #[test]
    fn rows_are_named_by_as_many_columns_as_it_takes() {
        assert_eq!(table().long(), [["some", "unit, 10", "ms", "0.666666667"].map(str::to_owned)]);
        let mut one = Table::new("one", ["set", "ms"]);
        one.row(cells!["unit", 1e-7f64]);
        assert_eq!(one.long()[0][1..], ["unit", "ms", "0.0000001"].map(str::to_owned));
    }

    #[test]
    fn a_table_is_shown_with_four_digits_and_kept_with_all_in_json() {
        assert!(table().show().contains("| unit |    10 | 0.6667 |"), "{}", table().show());
        assert_eq!(table().object()[1], json!({ "set": "unit", "boxes": 100, "ms": null }));
        assert_eq!(table().column("boxes").filter_map(Cell::number).sum::<f64>(), 110.0);
    }
}
