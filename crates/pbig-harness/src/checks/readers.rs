//! Files of any content: no more boxes than the bytes can hold, or one line of error.

use crate::files;

/// The bytes of an `.npy` file, read as boxes and as frames.
pub fn npy_reader(data: &[u8]) {
    check(files::npy_boxes(data).map(|boxes| 24 * boxes.len()), data);
    let size = |frames: files::Frames| 24 * frames.frames.iter().map(Vec::len).sum::<usize>();
    check(files::npy_frames(data).map(size), data);
}

/// The text of a `.csv` file.
pub fn csv_reader(data: &[u8]) {
    // Eleven characters at least: six numbers of a digit, five commas.
    check(files::csv_boxes(data).map(|boxes| 11 * boxes.len()), data);
}

fn check(needed: Result<usize, String>, data: &[u8]) {
    match needed {
        Ok(bytes) => assert!(bytes <= data.len(), "{bytes} bytes of boxes in {} of file", data.len()),
        Err(what) => assert!(!what.is_empty() && !what.contains('\n'), "{what:?}"),
    }
}
