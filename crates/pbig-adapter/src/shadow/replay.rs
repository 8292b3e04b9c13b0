//! Writes frames of boxes into a file for `pbig replay`.

use pbig_core::Aabb;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The reason why frames could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", file.display())]
pub struct ReplayError {
    /// The file.
    pub file: PathBuf,
    /// The cause.
    pub cause: std::io::Error,
}

/// Writes frames as `.npy` (F,N,6) float32, as `pbig replay` reads them. Boxes that a frame lacks are NaN.
///
/// # Errors
/// The file cannot be written.
pub fn write_frames<'a>(
    file: &Path,
    frames: impl IntoIterator<Item = &'a Vec<Aabb>>,
) -> Result<(), ReplayError> {
    let frames: Vec<&Vec<Aabb>> = frames.into_iter().collect();
    let boxes = frames.iter().map(|frame| frame.len()).max().unwrap_or(0);
    let write = || {
        let mut out = BufWriter::new(File::create(file)?);
        out.write_all(&head(frames.len(), boxes))?;
        for (frame, i) in frames.iter().flat_map(|frame| (0..boxes).map(move |i| (frame, i))) {
            let aabb = frame.get(i).unwrap_or(&Aabb::NOWHERE);
            out.write_all(aabb.min.map(f32::to_le_bytes).as_flattened())?;
            out.write_all(aabb.max.map(f32::to_le_bytes).as_flattened())?;
        }
        out.flush()
    };
    write().map_err(|cause| ReplayError { file: file.into(), cause })
}

/// Length of the text in the head of a file. With the ten bytes before it these are 128.
const HEAD_TEXT: u16 = 118;

/// Returns the head of an `.npy` file of version 1.0. Crates that write it bring twenty others to an app that checks.
fn head(frames: usize, boxes: usize) -> Vec<u8> {
    let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({frames}, {boxes}, 6), }}");
    let mut head = b"\x93NUMPY\x01\x00".to_vec();
    head.extend(HEAD_TEXT.to_le_bytes());
    head.extend(format!("{text:<0$}\n", usize::from(HEAD_TEXT) - 1).bytes());
    head
}

/// Writes a new file into `folder`. Its name has the time and the process, so that no two runs write the same file.
pub(super) fn write_into(folder: &Path, frames: &VecDeque<Vec<Aabb>>) -> Result<PathBuf, ReplayError> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let name = format!("pbig-difference-{}-{}.npy", now.as_nanos(), std::process::id());
    let file = folder.join(name);
    write_frames(&file, frames).map(|()| file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_a_head_of_128_bytes_and_nan_for_absent_boxes() {
        let aabb = |x: f32| Aabb::new([x; 3], [x + 1.0; 3]);
        let file = std::env::temp_dir().join(format!("pbig-replay-{}.npy", std::process::id()));
        for (frames, shape) in
            [(vec![vec![aabb(1.0), aabb(2.0)], vec![aabb(3.0)]], "(2, 2, 6)"), (vec![], "(0, 0, 6)")]
        {
            write_frames(&file, &frames).expect("written");
            let bytes = std::fs::read(&file).expect("read");
            assert_eq!(bytes[..10], *b"\x93NUMPY\x01\x00\x76\x00");
            let head = std::str::from_utf8(&bytes[10..128]).expect("text");
            assert!(head.contains(shape) && head.ends_with(" \n"), "{head}");
            let (values, rest) = bytes[128..].as_chunks::<4>();
            let values: Vec<_> = values.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            let (whole, absent) = values.split_at(values.len() / 4 * 3);
            let wanted: Vec<_> =
                frames.iter().flatten().flat_map(|aabb| [aabb.min, aabb.max].concat()).collect();
            assert_eq!((whole, rest.len()), (&wanted[..], 0));
            assert!(absent.len() * 3 == whole.len() && absent.iter().all(|x| x.is_nan()));
        }
        std::fs::remove_file(&file).expect("removed");
    }
}
