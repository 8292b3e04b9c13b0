//! Writes frames of boxes into a file for `pbig replay`.

use ndarray::Array3;
use ndarray_npy::{WriteNpyError, WriteNpyExt};
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
    pub cause: WriteNpyError,
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
    let array = Array3::from_shape_fn((frames.len(), boxes, 6), |(f, i, k)| {
        let aabb = frames[f].get(i).unwrap_or(&Aabb::NOWHERE);
        if k < 3 { aabb.min[k] } else { aabb.max[k - 3] }
    });
    let write = || -> Result<(), WriteNpyError> {
        let mut out = BufWriter::new(File::create(file)?);
        array.write_npy(&mut out)?;
        Ok(out.flush()?)
    };
    write().map_err(|cause| ReplayError { file: file.into(), cause })
}

/// Writes a new file into `folder`. Its name has the time and the process, so that no two runs write the same file.
pub(super) fn write_into(folder: &Path, frames: &VecDeque<Vec<Aabb>>) -> Result<PathBuf, ReplayError> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let name = format!("pbig-difference-{}-{}.npy", now.as_nanos(), std::process::id());
    let file = folder.join(name);
    write_frames(&file, frames).map(|()| file)
}
