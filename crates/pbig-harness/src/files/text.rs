//! The content of `.csv` files, read line by line.

use super::{BoxList, Location, MAX_BOXES, brief, one_line, too_many};
use pbig_core::Aabb;
use std::io::{self, BufRead};

/// Maximum length of a line, in bytes. Six numbers need a few hundred.
const MAX_LINE_BYTES: usize = 64 << 10;

/// The columns of a `.csv` file.
const COLUMNS: [&str; 6] = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];

/// The content of a `.csv` file of boxes, see [`super::read_boxes`].
pub fn csv_boxes(bytes: &[u8]) -> Result<Vec<Aabb>, String> {
    Ok(boxes(bytes, MAX_BOXES)?.boxes)
}

/// Reads boxes from a text. Stops at the first line that is wrong.
pub(super) fn boxes(reader: impl BufRead, max_boxes: u64) -> Result<BoxList, String> {
    let mut lines = Lines::new(reader, MAX_LINE_BYTES, "6 numbers");
    let (mut list, mut is_first) = (BoxList::default(), true);
    while lines.advance()? {
        let about = |what| format!("line {}: {what}", lines.number);
        let text = lines.text().map_err(about)?;
        let has_no_box = text.is_empty() || (is_first && is_header(text));
        if !has_no_box {
            list.push(csv_box(text, is_first).map_err(about)?, Location::Line(lines.number));
            check_count(list.boxes.len(), max_boxes).map_err(about)?;
        }
        is_first &= text.is_empty();
    }
    if lines.number == 0 { Err(empty()) } else { Ok(list) }
}

fn empty() -> String {
    format!("the file is empty; a list without boxes has the header {} alone", COLUMNS.join(","))
}

fn check_count(boxes: usize, limit: u64) -> Result<(), String> {
    if boxes as u64 > limit { Err(too_many(boxes, limit)) } else { Ok(()) }
}

pub(crate) fn too_long(longest: usize, expected: &str) -> String {
    format!("longer than {longest} bytes; expected {expected}")
}

/// Lines of bounded length, which end with `\n`, `\r\n` or `\r`.
pub(crate) struct Lines<R> {
    reader: R,
    /// Maximum length of a line, in bytes.
    longest: usize,
    /// Expected form of a line, for an error.
    expected: &'static str,
    /// The present line, without its end.
    pub(crate) bytes: Vec<u8>,
    /// Number of the present line, from 1.
    pub(crate) number: usize,
    /// The byte that ended the present line, or 0.
    ended_by: u8,
    /// True if an earlier line ended with `\r` alone.
    has_lone_cr: bool,
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(reader: R, longest: usize, expected: &'static str) -> Self {
        Self { reader, longest, expected, bytes: Vec::new(), number: 0, ended_by: 0, has_lone_cr: false }
    }

    /// Returns the reader behind the present line. A `\n` after a `\r` belongs to the line, unless other lines end with `\r` alone:
    /// then it is the first byte of what follows.
    pub(crate) fn into_rest(mut self) -> io::Result<R> {
        let is_half = self.ended_by == b'\r' && !self.has_lone_cr;
        if is_half && self.reader.fill_buf()?.starts_with(b"\n") {
            self.reader.consume(1);
        }
        Ok(self.reader)
    }

    /// Moves to the next line. Returns false at the end of the text.
    pub(crate) fn advance(&mut self) -> Result<bool, String> {
        let before = self.ended_by;
        if !self.fill().map_err(one_line)? {
            return Ok(false);
        }
        // The second half of `\r\n` ends no line of its own.
        if self.bytes.is_empty() && (before, self.ended_by) == (b'\r', b'\n') {
            return self.advance();
        }
        self.has_lone_cr |= before == b'\r';
        self.number += 1;
        match self.bytes.len() > self.longest {
            true => Err(format!("line {}: {}", self.number, too_long(self.longest, self.expected))),
            false => Ok(true),
        }
    }

    /// Reads up to the end of the line, or a little more than a line may have.
    fn fill(&mut self) -> io::Result<bool> {
        self.bytes.clear();
        loop {
            let chunk = self.reader.fill_buf()?;
            let chunk = &chunk[..chunk.len().min(self.longest + 1)];
            let end = chunk.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let length = end.unwrap_or(chunk.len());
            self.bytes.extend_from_slice(&chunk[..length]);
            self.ended_by = end.map_or(0, |end| chunk[end]);
            self.reader.consume(length + usize::from(end.is_some()));
            if end.is_some() || self.bytes.len() > self.longest {
                return Ok(true);
            }
            if length == 0 {
                return Ok(!self.bytes.is_empty());
            }
        }
    }
}

impl<R> Lines<R> {
    /// Returns the present line without the mark that some programs put before a text.
    fn text(&self) -> Result<&str, String> {
        let text = std::str::from_utf8(&self.bytes);
        let text = text.map_err(|_| "this is not UTF-8; save the file as UTF-8 text")?;
        let text = if self.number == 1 { text.trim_start_matches('\u{feff}') } else { text };
        Ok(text.trim())
    }
}

/// Returns the values of a line without spaces and quotation marks around them.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    let mut is_quoted = false;
    let between = move |c| {
        is_quoted ^= c == '"';
        c == ',' && !is_quoted
    };
    line.split(between).map(|field| {
        let field = field.trim();
        let inner = field.strip_prefix('"').and_then(|field| field.strip_suffix('"'));
        inner.unwrap_or(field).trim()
    })
}

/// Returns true for the column names and nothing else: a file that begins with other words is not taken for empty.
/// `numpy.savetxt` writes a `#` before them.
fn is_header(line: &str) -> bool {
    let line = line.trim_start_matches('#');
    fields(line).count() == 6
        && fields(line).zip(COLUMNS).all(|(field, name)| field.eq_ignore_ascii_case(name))
}

/// Returns a message about the whole file rather than a value.
fn wrong_throughout(line: &str, is_first: bool) -> Option<String> {
    for (separator, name) in [(';', "semicolons"), ('\t', "tabs")] {
        if fields(line).any(|field| field.contains(separator)) {
            return Some(format!("values are separated by {name}; expected commas"));
        }
    }
    let is_name = |field: &str| field.starts_with(|c: char| c.is_alphabetic() || c == '#');
    let is_other_header = is_first && fields(line).all(is_name);
    if is_other_header {
        return Some(format!("the header must be {}, or be left out", COLUMNS.join(",")));
    }
    let has_spaces = fields(line).count() == 1 && line.split_whitespace().count() > 1;
    has_spaces
        .then(|| "values are separated by spaces; expected commas: numpy.savetxt takes delimiter=','".into())
}

fn csv_box(line: &str, is_first: bool) -> Result<Aabb, String> {
    values(line).map_err(|what| wrong_throughout(line, is_first).unwrap_or(what))
}

fn values(line: &str) -> Result<Aabb, String> {
    let count = fields(line).count();
    if count == 7 && line.ends_with(',') {
        return Err("a comma follows the sixth value; remove the comma at the end of each line".into());
    }
    if count != 6 {
        return Err(format!("expected 6 columns, separated by commas, found {count}"));
    }
    let mut values = [0.0f32; 6];
    for (column, (value, field)) in values.iter_mut().zip(fields(line)).enumerate() {
        let wrong = |_| format!("column {}: '{}' is not a number", column + 1, brief(field));
        *value = field.parse().map_err(wrong)?;
    }
    let [a, b, c, d, e, f] = values;
    Ok(Aabb::new([a, b, c], [d, e, f]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, Read, repeat};

    fn error(text: &str) -> String {
        csv_boxes(text.as_bytes()).expect_err("refused")
    }

    /// A reader without an end: only a bound lets this end.
    #[test]
    fn a_line_without_an_end_is_refused() {
        let wanted = "longer than 65536 bytes; expected 6 numbers";
        let first = boxes(BufReader::new(repeat(0)), 9).expect_err("refused");
        assert_eq!(first, format!("line 1: {wanted}"));
        let second = boxes(BufReader::new(b"0,0,0,1,1,1\n\"".chain(repeat(b'0'))), 9).expect_err("refused");
        assert_eq!(second, format!("line 2: {wanted}"));
        let longest = format!("{}0,0,0,1,1,1\n", " ".repeat(MAX_LINE_BYTES - 11));
        assert_eq!(csv_boxes(longest.as_bytes()).expect("just short enough").len(), 1);
        assert_eq!(error(&format!(" {longest}")), format!("line 1: {wanted}"));
    }

    #[test]
    fn the_first_wrong_line_ends_the_reading() {
        let rest = repeat(b'\xff');
        let read = boxes(BufReader::new(b"0,0,0,1,1,1\nx\n".chain(rest)), 9);
        assert_eq!(read.expect_err("refused"), "line 2: expected 6 columns, separated by commas, found 1");
    }

    #[test]
    fn a_comma_at_the_end_is_explained() {
        let wanted = "a comma follows the sixth value; remove the comma at the end of each line";
        assert_eq!(error("0,0,0,1,1,1\n0,0,0,1,1,1, \r\n"), format!("line 2: {wanted}"));
        assert_eq!(error("0,0,0,1,1,1,1\n"), "line 1: expected 6 columns, separated by commas, found 7");
    }

    #[test]
    fn too_many_boxes_are_refused_while_they_are_read() {
        let line = b"0,0,0,1,1,1\n";
        let three = [&line[..]; 3].concat();
        assert_eq!(boxes(&three[..], 3).expect("as many as may be").boxes.len(), 3);
        let what = boxes(BufReader::new((&three[..]).chain(&line[..]).chain(repeat(b'\n'))), 3)
            .expect_err("too many");
        assert!(what.starts_with("line 4: 4 boxes are more than 3; for more"), "{what}");
    }

    #[test]
    fn lines_are_counted_whatever_ends_them() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["0,0,0,1,1,1", "", "0,0,0,1,1,1", "x"].join(end);
            assert_eq!(error(&text), "line 4: expected 6 columns, separated by commas, found 1", "{end:?}");
        }
    }

    #[test]
    fn the_header_of_savetxt_and_a_byte_order_mark_are_read() {
        let one = csv_boxes(b"0,0,0,1,1,1\n");
        for head in
            ["# min_x,min_y,min_z,max_x,max_y,max_z\n", "#MIN_X, min_y,min_z,max_x,max_y,max_z\n", "\u{feff}"]
        {
            assert_eq!(csv_boxes(format!("{head}0,0,0,1,1,1\n").as_bytes()), one, "{head}");
        }
        assert_eq!(csv_boxes(b" \"0\",\"0\" ,0,1,\" 1\",1e0\n"), one);
        let wanted = "line 1: the header must be min_x,min_y,min_z,max_x,max_y,max_z, or be left out";
        assert_eq!(error("# max_x,max_y,max_z,min_x,min_y,min_z\n"), wanted);
        assert_eq!(error("# boxes of a level\n"), wanted);
        let later = error("0,0,0,1,1,1\n# min_x,min_y,min_z,max_x,max_y,max_z\n");
        assert_eq!(later, "line 2: column 1: '# min_x' is not a number");
    }
}
