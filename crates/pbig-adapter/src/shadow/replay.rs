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

/// Returns the head of an `.npy` file of version 1.0: 128 bytes. A crate for it would bring twenty to every app that checks.
fn head(frames: usize, boxes: usize) -> Vec<u8> {
    let shape = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({frames}, {boxes}, 6), }}");
    let mut head = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    head.extend(format!("{shape:<117}\n").bytes());
    head
}

/// Writes a new file into `folder`. Its name has the time and the process, so that no two runs write the same file.
pub(super) fn write_into(folder: &Path, frames: &VecDeque<Vec<Aabb>>) -> Result<PathBuf, ReplayError> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let name = format!("pbig-difference-{}-{}.npy", now.as_nanos(), std::process::id());
    let file = folder.join(name);
    write_frames(&file, frames).map(|()| file)
}
