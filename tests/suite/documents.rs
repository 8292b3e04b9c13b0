//! Holds the numbers of the documents against the measured ones. A block of numbers lies between two marks:
//!
//! ```text
//! <!-- from: docs/benchmarks/results/frames.csv | scene= | bodies= | stock_ms [queries=none] & pbig_ms [queries=none] | _ | -->
//! | scene | bodies | ms | remark |
//! |---|---|---|---|
//! | rain | 1000 | 3.54 → 3.18 | like table 3 |
//! <!-- end -->
//! ```
//!
//! The first mark names files (`*` stands for any end of a name) and where the numbers of each cell come from: a column, with
//! the values of other columns that choose its row. `scene=` makes the cell itself such a value, up to a colon. `_` is not
//! checked; a cell without a source may have no numbers. A mark has one line for all rows, or one for each row; text counts as
//! one cell. Numbers are rounded to the digits shown, and have no signs. Numbers in backticks are not checked.

use regex::Regex;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

/// A row of a file: its values by column, and the file's name as the column `file`.
type Row = BTreeMap<String, String>;

fn pattern(text: &str) -> Regex {
    Regex::new(text).expect("a pattern")
}

/// Returns the numbers of a text with their digits behind the point. Digits right behind a letter are a name's, as in `f32`.
fn numbers(text: &str) -> Vec<(f64, i32)> {
    static WORDS: LazyLock<Regex> =
        LazyLock::new(|| pattern(r"[\p{L}_](?:[\p{L}0-9_]|[.,][0-9])*|([0-9]+(?:[.,][0-9]+|e-?[0-9]+)*)"));
    let found = WORDS.captures_iter(text).filter_map(|found| found.get(1));
    found.map(|number| number_of(&number.as_str().replace(',', ""))).collect()
}

fn number_of(text: &str) -> (f64, i32) {
    let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let digits = mantissa.split_once('.').map_or(0, |(_, fraction)| fraction.len() as i32);
    (text.parse().unwrap_or(f64::NAN), digits - exponent.parse().unwrap_or(0))
}

/// Returns a text without what is in backticks or the address of a link.
fn plain(text: &str) -> String {
    static HIDDEN: LazyLock<Regex> = LazyLock::new(|| pattern(r"`[^`]*`|\]\([^)]*\)"));
    HIDDEN.replace_all(text, " ").into_owned()
}

fn cells(line: &str) -> Vec<&str> {
    let line = line.trim();
    let line = line.strip_prefix('|').unwrap_or(line);
    line.strip_suffix('|').unwrap_or(line).split('|').map(str::trim).collect()
}

/// Returns the name in a cell: without backticks, up to a colon.
fn name(cell: &str) -> String {
    cell.split(": ").next().unwrap_or_default().replace('`', "")
}

fn add_rows(file: &str, csv: &str, rows: &mut Vec<Row>) {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(csv.as_bytes());
    for row in reader.deserialize::<Row>() {
        let mut row = row.unwrap_or_else(|error| panic!("{file}: {error}"));
        row.insert("file".into(), file.into());
        rows.push(row);
    }
}

/// Returns the numbers that a source, such as `ms [side=pbig; threads=2]`, has in the rows with these keys.
fn values(source: &str, keys: &[(&str, String)], rows: &[Row]) -> Result<Vec<f64>, String> {
    let (column, conditions) = source.trim_end_matches(']').split_once(" [").unwrap_or((source, ""));
    let conditions = conditions.split("; ").filter_map(|condition| condition.split_once('='));
    let mut wanted: Vec<(&str, String)> = conditions.map(|(key, value)| (key, value.into())).collect();
    wanted.extend_from_slice(keys);
    let has = |row: &&Row| wanted.iter().all(|(key, value)| row.get(*key) == Some(value));
    let found: Vec<&String> = rows.iter().filter(has).filter_map(|row| row.get(column)).collect();
    match found[..] {
        [one] => Ok(one.parse().map(f64::abs).into_iter().collect()),
        _ => Err(format!("{} rows have the column {column} and {wanted:?}", found.len())),
    }
}

fn check_cell(cell: &str, sources: &str, keys: &[(&str, String)], rows: &[Row]) -> Result<(), String> {
    let sources = sources.split(" & ").filter(|source| !source.is_empty());
    let values: Vec<Vec<f64>> =
        sources.map(|source| values(source, keys, rows)).collect::<Result<_, String>>()?;
    let (values, shown) = (values.concat(), numbers(&plain(cell)));
    let is_near = |(value, (shown, digits)): (&f64, &(f64, i32))| {
        (value - shown).abs() <= 0.5 * 10f64.powi(-digits) * (1.0 + 1e-6)
    };
    let is_right = values.len() == shown.len() && values.iter().zip(&shown).all(is_near);
    is_right.then_some(()).ok_or_else(|| format!("'{cell}' should be {values:?}"))
}

/// Returns the faults of a row of a document.
fn check_row(line: &str, sources: &str, rows: &[Row]) -> Vec<String> {
    let (shown, sources) = (cells(line), cells(sources));
    if shown.len() != sources.len() {
        return vec![format!("{} cells for {} sources: {line}", shown.len(), sources.len())];
    }
    let both = || shown.iter().zip(&sources);
    let keys = both().filter_map(|(cell, source)| Some((source.strip_suffix('=')?, name(cell))));
    let keys: Vec<(&str, String)> = keys.collect();
    let is_checked = |cell: &str, source: &str| !cell.is_empty() && source != "_" && !source.ends_with('=');
    let numbers = both().filter(|(cell, source)| is_checked(cell, source));
    let faults = numbers.filter_map(|(cell, source)| check_cell(cell, source, &keys, rows).err());
    faults.map(|fault| format!("{}: {fault}", shown[0])).collect()
}

/// Returns the faults of a block.
fn check_block(mark: &str, text: &str, read: &impl Fn(&str, &mut Vec<Row>)) -> Vec<String> {
    let (files, sources) = mark.split_once('|').unwrap_or((mark, ""));
    let (mut rows, joined) = (vec![], text.replace('\n', " "));
    files.split(", ").for_each(|file| read(file.trim(), &mut rows));
    let lines: Vec<&str> = if text.starts_with('|') { text.lines().skip(2).collect() } else { vec![&joined] };
    let sources: Vec<&str> = match sources.trim().lines().collect::<Vec<_>>()[..] {
        [one] => vec![one; lines.len()],
        ref several => several.to_vec(),
    };
    if sources.len() != lines.len() {
        return vec![format!("{} lines of sources for {} rows: {text}", sources.len(), lines.len())];
    }
    lines.iter().zip(sources).flat_map(|(line, sources)| check_row(line, sources, &rows)).collect()
}

/// Returns each wrong number of a document, and says if a mark has no partner. `read` appends the rows of a file.
fn faults(document: &str, read: impl Fn(&str, &mut Vec<Row>)) -> Vec<String> {
    static BLOCK: LazyLock<Regex> =
        LazyLock::new(|| pattern(r"(?ms)^<!-- from: (.*?)-->\n(.*?)^<!-- end -->"));
    let blocks: Vec<_> = BLOCK.captures_iter(document).map(|found| found.extract().1).collect();
    let mut faults: Vec<String> =
        blocks.iter().flat_map(|[mark, text]| check_block(mark, text, &read)).collect();
    let marks = ["<!-- from: ", "<!-- end -->"].map(|mark| document.matches(mark).count());
    faults.extend((marks != [blocks.len(); 2]).then(|| format!("{marks:?} marks, {} blocks", blocks.len())));
    faults
}

/// Appends the rows of a file, or of all files whose names begin as the text before `*`.
fn read(file: &str, rows: &mut Vec<Row>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (folder, start) = file.trim_end_matches('*').rsplit_once('/').expect("a folder");
    let files = walkdir::WalkDir::new(root.join(folder)).sort_by_file_name();
    for path in files.into_iter().map(|entry| entry.expect("a readable folder").into_path()) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if name == start || (file.ends_with('*') && name.starts_with(start)) {
            add_rows(name.trim_end_matches(".csv"), &text_of(&path), rows);
        }
    }
}

fn text_of(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn numbers_in_documents_are_measured_ones() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let files = walkdir::WalkDir::new(root.join("docs")).into_iter();
    let files = files.map(|entry| entry.expect("a readable folder").into_path());
    let documents = files.filter(|path| path.extension().is_some_and(|ending| ending == "md"));
    for path in documents.chain([root.join("README.md")]) {
        let faults = faults(&text_of(&path), read);
        assert!(faults.is_empty(), "{}: {faults:#?}", path.display());
    }
}

const RESULTS: &str = "# threads: 2\nscene,side,ms,percent\n\"column, 500\",ours,1234.5678,-0.35\n\
    \"column, 500\",other,99.5,7\nrain,ours,3.25,\nrain,other,8,9\n";

/// Returns the faults of a table or text with these sources.
fn found(sources: &str, text: &str) -> Vec<String> {
    let document = format!("7\n<!-- from: some.csv\n{sources}\n-->\n{text}\n<!-- end -->\n8\n");
    faults(&document, |_, rows| add_rows("some", RESULTS, rows))
}

#[test]
fn a_number_of_another_row_or_column_is_refused() {
    let sources = "| scene= | ms [side=ours] & ms [side=other] | percent [side=ours] |";
    let table = |rows: &str| found(sources, &format!("| a | b | c |\n|---|---|---|\n{rows}"));
    let right = "| `column, 500` | 1,234.57 → 100 | f32 `7` 0.35 |\n| rain: heavy | 3.3 → 8 | none |";
    assert_eq!(table(right), [""; 0]);
    for (from, to) in [
        ("1,234.57", "3.25"),
        ("→ 8", "→ 99.5"),
        ("0.35", "7"),
        ("none", "9"),
        ("0.35", "0.351"),
        (" → 8", ""),
    ] {
        assert_eq!(table(&right.replace(from, to)).len(), 1, "{to} instead of {from}");
    }
    assert_eq!(table("| snow | 1 → 2 | 3 |").len(), 2, "no such row");
    assert_eq!(table("| rain | 3.25 |").len(), 1, "a cell is missing");
}

#[test]
fn text_and_rows_with_sources_of_their_own_are_checked() {
    let text = "In 1234.6 ms\nor 8.0 ([9](9.md)).";
    let sources =
        "| ms [scene=column, 500; side=ours] & ms [scene=rain; side=other] & percent [ms=8; file=some] |";
    assert_eq!(found(sources, text), [""; 0]);
    assert_eq!(found(sources, &text.replace("8.0", "8.1")).len(), 1);
    assert_eq!(found("| ms [side=ours] |", "3.25").len(), 1, "two rows match");
    let rows = "| a | b |\n|---|---|\n| part 1 | 7 |\n| part 2 | |";
    assert_eq!(found("| _ | percent [ms=99.5] |\n| _ | |", rows), [""; 0]);
    assert_eq!(found("| _ | |\n| _ | |\n| _ | |", rows).len(), 1, "more sources than rows");
    assert_eq!(found("| 9 |", "<!-- from: b.csv\n| ms |\n-->\n3").len(), 2, "a mark without an end");
}

#[test]
fn numbers_are_read_as_they_are_written() {
    let wanted = [(1.0, 0), (2.71, 2), (3e-7, 7), (10.0, 0), (7.0, 0), (4.0, 0)];
    assert_eq!(numbers("1→2.71, 3e-7 x86 10^7, 4."), wanted);
}
