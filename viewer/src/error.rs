//! Errors, in words that say what to do.

use std::fmt;
use std::path::PathBuf;

/// An error of the viewer.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// There is no graphics adapter, not even a software one.
    NoAdapter(String),
    /// There is no display for a window: the reason.
    NoDisplay(String),
    /// An update of the broad phase failed: the number of the step, and the reason.
    Step(u64, String),
    /// A file or folder cannot be written: its path, and the reason.
    File(PathBuf, String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdapter(why) => write!(
                f,
                "there is no graphics adapter: {why}\na software one will do; on Debian and Ubuntu: \
                 apt install mesa-vulkan-drivers libvulkan1"
            ),
            Self::NoDisplay(why) => {
                write!(f, "there is no display: {why}\n--frames DIR writes pictures without one")
            }
            Self::Step(step, why) => write!(f, "step {step}: {why}"),
            Self::File(path, why) => write!(f, "{}: {why}", path.display()),
        }
    }
}

impl std::error::Error for Error {}
