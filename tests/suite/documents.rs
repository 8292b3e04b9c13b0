//! Holds the numbers of the documents against the measured ones: each number between `<!-- from: FILE.csv, FILE.csv -->` and
//! `<!-- end -->` is a value of one of these files, rounded to the digits shown. Names in backticks and names of rows are left out.

use regex::Regex;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The content of a file of results: its numbers, without their signs, and its texts.
#[derive(Default)]
struct Known {
    numbers: Vec<f64>,
    texts: BTreeSet<String>,
}

impl Known {
    fn of(files: &[String]) -> Self {
        let mut known = Self::default();
        files.iter().for_each(|csv| known.add_file(csv));
        known
    }

    fn add_file(&mut self, csv: &str) {
        let head = csv.lines().filter(|line| line.starts_with('#'));
        head.for_each(|line| self.numbers.extend(tokens(line).into_iter().map(|token| token.value)));
        let mut reader =
            csv::ReaderBuilder::new().comment(Some(b'#')).has_headers(false).from_reader(csv.as_bytes());
        for record in reader.records() {
            record.expect("a row").iter().for_each(|cell| self.add(cell));
        }
    }

    /// The name of a row counts as a whole, and so does each number in it.
    fn add(&mut self, cell: &str) {
        match cell.parse::<f64>() {
            Ok(number) => self.numbers.push(number.abs()),
            Err(_) => {
                self.numbers.extend(tokens(cell).into_iter().map(|token| token.value));
                self.texts.extend([cell.to_owned()]);
            }
        }
    }

    fn has(&self, token: &Token) -> bool {
        let half = 0.5 * 10f64.powi(-token.digits) * (1.0 + 1e-6);
        self.numbers.iter().any(|number| (number - token.value).abs() <= half)
    }
}

/// A number as written, with its digits behind the point.
#[derive(Debug, PartialEq)]
struct Token {
    text: String,
    value: f64,
    digits: i32,
}

/// Returns the numbers of a text, without signs. Digits right behind a letter are a name's, as in `f32`. Points and commas are a
/// number's own if a digit follows.
fn tokens(text: &str) -> Vec<Token> {
    static WORDS: LazyLock<Regex> = LazyLock::new(|| {
        Regex::new(r"[\p{L}_](?:[\p{L}0-9_]|[.,][0-9])*|([0-9]+(?:[.,][0-9]+|e-?[0-9]+)*)")
            .expect("a pattern")
    });
    WORDS.captures_iter(text).filter_map(|found| found.get(1)).map(|number| token(number.as_str())).collect()
}

fn token(text: &str) -> Token {
    let plain = text.replace(',', "");
    let (mantissa, exponent) = plain.split_once('e').unwrap_or((&plain, "0"));
    let digits = mantissa.split_once('.').map_or(0, |(_, fraction)| fraction.len() as i32);
    let exponent: i32 = exponent.parse().unwrap_or(0);
    Token { text: text.into(), value: plain.parse().unwrap_or(f64::NAN), digits: digits - exponent }
}

/// Returns a line without what is in backticks or the address of a link.
fn plain(line: &str) -> String {
    let outside: String = line.split('`').step_by(2).collect::<Vec<_>>().join(" ");
    let mut parts = outside.split("](");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + " " + part.split_once(')').map_or("", |(_, after)| after))
}

/// Returns the numbers of a line that the results do not have. A table's cell that is a name there is left out.
fn wrong(line: &str, known: &Known) -> Vec<String> {
    let cells: Vec<&str> = if line.starts_with('|') { line.split('|').collect() } else { vec![line] };
    let cells = cells.into_iter().filter(|cell| !known.texts.contains(cell.trim()));
    let found = cells.flat_map(|cell| tokens(&plain(cell)));
    found.filter(|token| !known.has(token)).map(|token| token.text).collect()
}

/// Returns each wrong number of a document with its line, and blocks that do not end; and how many blocks there are.
fn faults(document: &str, read: impl Fn(&str) -> String) -> (Vec<String>, usize) {
    let (mut faults, mut blocks, mut known) = (vec![], 0, None);
    for (i, line) in document.lines().enumerate() {
        if let Some(files) = line.trim().strip_prefix("<!-- from: ") {
            let files = files.trim_end_matches("-->").split(',').map(|file| read(file.trim()));
            (known, blocks) = (Some(Known::of(&files.collect::<Vec<_>>())), blocks + 1);
        } else if line.trim() == "<!-- end -->" {
            known = None;
        } else if let Some(known) = &known {
            faults.extend(wrong(line, known).into_iter().map(|number| format!("line {}: {number}", i + 1)));
        }
    }
    faults.extend(known.map(|_| "a block without an end".to_owned()));
    (faults, blocks)
}

#[test]
fn numbers_in_documents_are_measured_ones() {
    let files = walkdir::WalkDir::new(root().join("docs"));
    let files = files.into_iter().map(|entry| entry.expect("a readable folder").into_path());
    let documents = files.filter(|path| path.extension().is_some_and(|ending| ending == "md"));
    let read = |path: &Path| {
        std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    for path in documents.chain([root().join("README.md")]) {
        let (faults, _) = faults(&read(&path), |file| read(&root().join(file)));
        assert!(faults.is_empty(), "{}: {faults:#?}", path.display());
    }
}

const RESULTS: &str =
    "# threads: 2\ntable,row,column,value\nruns,\"column, 500\",ms,1234.5678\nruns,2 steps,percent,-0.35\n";

#[test]
fn a_wrong_number_is_noticed() {
    let document = "9\n<!-- from: some.csv -->\n| 2 steps | `7` | 500 | 1,234.57 | 1235 | f32 | -0.35 |\nOn 2 threads 1234.58.\n<!-- end -->\n8";
    let (found, blocks) = faults(document, |_| RESULTS.to_owned());
    assert_eq!((found, blocks), (vec!["line 4: 1234.58".to_owned()], 1));
    let (found, _) = faults("<!-- from: some.csv -->\n[3](4)", |_| RESULTS.to_owned());
    assert_eq!(found, ["line 2: 3", "a block without an end"]);
    let two = |file: &str| if file == "a.csv" { "x\n3".to_owned() } else { "x\n4".to_owned() };
    assert_eq!(faults("<!-- from: a.csv, b.csv -->\n3, 4 and 5\n<!-- end -->", two).0, ["line 2: 5"]);
}

#[test]
fn numbers_are_read_as_they_are_written() {
    let read: Vec<_> =
        tokens("1→2.71, 3e-7 x86 10^7, 4.").into_iter().map(|token| (token.text, token.digits)).collect();
    let wanted = [("1", 0), ("2.71", 2), ("3e-7", 7), ("10", 0), ("7", 0), ("4", 0)];
    assert_eq!(read, wanted.map(|(text, digits)| (text.to_owned(), digits)));
}
