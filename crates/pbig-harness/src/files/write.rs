//! Files that the program `pbig` writes.

use super::{BOXES_OR_PAIRS, at, ending, name};
use ndarray::Array2;
use pbig_core::Pair;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::Path;

/// Returns true for `-`, the name of stdin and stdout.
pub fn is_stream(path: &Path) -> bool {
    path == "-"
}

/// Checks, before the work, that an output has a known ending and is not the input.
pub fn check_output(option: &str, output: &Path, known: &[&str], input: &Path) -> Result<(), String> {
    if is_stream(output) {
        return Ok(());
    }
    ending(output, known)?;
    match is_same_file(output, input) {
        true => Err(at(output, format!("{option} names the input, {}; name another file", name(input)))),
        false => Ok(()),
    }
}

/// Returns true if two paths lead to one file, also through links.
fn is_same_file(a: &Path, b: &Path) -> bool {
    matches!((identity(a), identity(b)), (Ok(a), Ok(b)) if a == b)
}

#[cfg(unix)]
fn identity(path: &Path) -> io::Result<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(path).map(|about| (about.dev(), about.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> io::Result<std::path::PathBuf> {
    path.canonicalize()
}

/// Pairs as `.npy` (K,2) uint32 or `.csv`.
pub fn write_pairs(path: &Path, pairs: &[Pair]) -> Result<(), String> {
    write_id_pairs(path, pairs.iter().map(|pair| [pair.a, pair.b]))
}

/// Pairs of any two lists, as [`write_pairs`] does.
pub fn write_id_pairs(path: &Path, pairs: impl Iterator<Item = [u32; 2]>) -> Result<(), String> {
    if is_stream(path) || ending(path, &BOXES_OR_PAIRS)? == "csv" {
        return write_csv(path, "a,b", pairs.map(|[a, b]| format!("{a},{b}")));
    }
    let flat: Vec<u32> = pairs.flatten().collect();
    let array = Array2::from_shape_vec((flat.len() / 2, 2), flat).map_err(|error| at(path, error))?;
    ndarray_npy::write_npy(path, &array).map_err(|error| at(path, error))
}

/// A text file of a header and lines, or these on stdout.
pub fn write_csv(path: &Path, header: &str, lines: impl IntoIterator<Item = String>) -> Result<(), String> {
    if is_stream(path) {
        return match write_lines(io::stdout().lock(), header, lines) {
            // A reader that has gone away (`| head`) is not an error.
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(at(Path::new("stdout"), error)),
            _ => Ok(()),
        };
    }
    ending(path, &["csv"])?;
    let written = File::create(path).and_then(|file| write_lines(file, header, lines));
    written.map_err(|error| at(path, error))
}

fn write_lines(to: impl Write, header: &str, lines: impl IntoIterator<Item = String>) -> io::Result<()> {
    let mut to = BufWriter::new(to);
    writeln!(to, "{header}")?;
    for line in lines {
        writeln!(to, "{line}")?;
    }
    to.flush()
}
