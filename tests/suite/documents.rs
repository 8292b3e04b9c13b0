//! Writes the tables of the documents from measured numbers, or compares them. A table lies between two marks:
//!
//! ```text
//! <!-- table: frames -->
//! ...
//! <!-- end -->
//! ```
//!
//! `WRITE_TABLES=1 cargo test --release --test suite documents::` writes all tables; without the variable they are compared.

mod tables;

use regex::Regex;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tables::{TABLES, Table};

/// Returns a value as it is shown: numbers with a fraction have three digits, large ones commas.
fn shown(value: &str) -> String {
    let Ok(number) = value.parse::<f64>() else { return value.replace('|', "\\|") };
    let digits = value.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    let needed = (2.0 - number.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{number:.*}", needed.min(digits));
    if number < 10_000.0 { text } else { with_commas(&text) }
}

fn with_commas(digits: &str) -> String {
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect();
    groups.join(",")
}

/// Returns where and when the numbers were measured, as the head of the file says: a line of its own.
fn caption(csv: &str) -> String {
    let is_shown = |entry: &&str| match entry.split_once(": ") {
        Some(("machine" | "cores" | "threads" | "day", _)) => true,
        Some(("adapter", name)) => !name.contains("software"),
        _ => false,
    };
    let head = csv.lines().filter_map(|line| line.strip_prefix("# ")).filter(is_shown);
    let head: Vec<_> = head.collect();
    if head.is_empty() { String::new() } else { format!("\n_{}_\n", head.join(", ")) }
}

/// Returns a table as text, or says which value or column the file lacks.
fn render(table: &Table, csv: &str) -> Result<String, String> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(csv.as_bytes());
    let rows: Result<Vec<BTreeMap<String, String>>, _> = reader.deserialize().collect();
    let mut rows = rows.map_err(|error| format!("{}: {error}", table.csv))?;
    for (column, values) in table.rows {
        let has = |row: &BTreeMap<_, _>, value| row.get(*column).is_some_and(|found| found == value);
        if let Some(value) = values.split('|').find(|value| !rows.iter().any(|row| has(row, *value))) {
            return Err(format!("{}: no row has {column} {value}", table.csv));
        }
        rows.retain(|row| values.split('|').any(|value| has(row, value)));
    }
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let headings = table.columns.iter().map(|(heading, _)| heading.to_string()).collect();
    let mut text = line(headings) + "|" + &"---|".repeat(table.columns.len()) + "\n";
    for row in &rows {
        text += &line(table.columns.iter().map(|(_, columns)| cell(row, columns)).collect::<Result<_, _>>()?);
    }
    Ok(text + &caption(csv))
}

/// Returns the values of a cell, with an arrow at which no line breaks between them.
fn cell(row: &BTreeMap<String, String>, columns: &str) -> Result<String, String> {
    let value = |column| row.get(column).map(|value| shown(value)).ok_or(format!("no column {column}"));
    Ok(columns.split(" → ").map(value).collect::<Result<Vec<_>, _>>()?.join("\u{a0}→\u{a0}"))
}

/// Returns a document with its tables written anew, and their names. `text` returns the table of a name.
fn written(document: &str, text: impl Fn(&str) -> Result<String, String>) -> (String, Vec<String>) {
    let pattern = Regex::new(r"(?ms)^<!-- table: ([^ ]+) -->\n.*?^<!-- end -->$").expect("a pattern");
    let mut names = vec![];
    let new = pattern.replace_all(document, |found: &regex::Captures| {
        names.push(found[1].to_owned());
        let text = text(&found[1]).unwrap_or_else(|error| panic!("table {}: {error}", &found[1]));
        format!("<!-- table: {} -->\n{text}\n<!-- end -->", &found[1])
    });
    let new = new.into_owned();
    assert_eq!(["<!-- table:", "<!-- end"].map(|mark| new.matches(mark).count()), [names.len(); 2]);
    (new, names)
}

fn measured(name: &str) -> Result<String, String> {
    let table = TABLES.iter().find(|table| table.name == name).ok_or("it is not defined in tables.rs")?;
    render(table, &text_of(&root().join(format!("docs/benchmarks/results/{}.csv", table.csv))))
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text_of(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.replace("\r\n", "\n")
}

/// Returns the paths of all files below `docs` with this ending.
fn files(ending: &str) -> Vec<PathBuf> {
    let files = walkdir::WalkDir::new(root().join("docs")).sort_by_file_name().into_iter();
    let files = files.map(|entry| entry.expect("a readable folder").into_path());
    files.filter(|path| path.extension().is_some_and(|found| found == ending)).collect()
}

#[test]
fn tables_have_the_measured_numbers() {
    let mut used = vec![];
    for path in files("md")
        .into_iter()
        .chain(["README.md", "avian/README.md", "python/README.md"].map(|file| root().join(file)))
    {
        let document = text_of(&path);
        let (new, names) = written(&document, measured);
        used.extend(names);
        if std::env::var_os("WRITE_TABLES").is_some() && new != document {
            std::fs::write(&path, new).expect("a writable document");
        } else {
            assert_eq!(document, new, "{}: WRITE_TABLES=1 writes the tables again", path.display());
        }
    }
    let mut defined: Vec<_> = TABLES.iter().map(|table| table.name).collect();
    defined.sort_unstable();
    used.sort_unstable();
    assert_eq!(defined, used, "each table is defined once and used once");
}

#[test]
fn each_file_of_results_has_a_table() {
    let is_used = |path: &PathBuf| TABLES.iter().any(|table| path.file_stem() == Some(table.csv.as_ref()));
    let unused: Vec<_> = files("csv").into_iter().filter(|path| !is_used(path)).collect();
    assert!(unused.is_empty(), "no document shows {unused:?}");
}

const CSV: &str = "# machine: PC\n# cores: 2\n# day: 2026-11-25\nscene,side,ms,pairs\nrain,ours,3.14159,12345678\n\
    rain,other,1234.5,\n\"pile, big\",ours,0.001,7\n";

const ROWS: Table = Table {
    name: "rows",
    csv: "rows",
    rows: &[("side", "ours")],
    columns: &[("scene", "scene"), ("ms, pairs", "ms → pairs")],
};

const DOCUMENT: &str = "A 3.15.\n\n<!-- table: rows -->\n| scene | ms, pairs |\n|---|---|\n\
    | rain | 3.14\u{a0}→\u{a0}12,345,678 |\n| pile, big | 0.001\u{a0}→\u{a0}7 |\n\n_machine: PC, cores: 2, day: 2026-11-25_\n\n<!-- end -->\n\n9\n";

#[test]
fn a_changed_digit_is_found_and_written_again() {
    let again = |document: &str| written(document, |_| render(&ROWS, CSV)).0;
    assert_eq!(again(DOCUMENT), DOCUMENT);
    for (right, wrong) in
        [("3.14", "3.15"), ("12,345", "12,346"), ("| pile, big | 0.001\u{a0}→\u{a0}7 |\n", "")]
    {
        let planted = DOCUMENT.replacen(right, wrong, 1);
        assert_ne!(again(&planted), planted, "{wrong}");
        assert_eq!(again(&planted), DOCUMENT);
    }
}

#[test]
fn missing_values_columns_and_marks_are_errors() {
    let table = |rows, columns| render(&Table { rows, columns, ..ROWS }, CSV);
    assert_eq!(table(&[("side", "ours|none")], &[]), Err("rows: no row has side none".into()));
    assert_eq!(table(&[("size", "1")], &[]), Err("rows: no row has size 1".into()));
    assert_eq!(table(&[], &[("s", "seconds")]), Err("no column seconds".into()));
    let unpaired = DOCUMENT.replace("<!-- end -->", "");
    assert!(std::panic::catch_unwind(|| written(&unpaired, |_| Ok(String::new()))).is_err());
    assert!(measured("rows").is_err_and(|error| error.contains("not defined")));
}

#[test]
fn numbers_have_three_digits() {
    let values = ["1234.56", "0.0012345", "2.5", "100000", "9999", "0", "12345.6", "f64", ""];
    let wanted = ["1235", "0.00123", "2.5", "100,000", "9999", "0", "12,346", "f64", ""];
    assert_eq!(values.map(shown), wanted);
}
