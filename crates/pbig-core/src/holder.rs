//! The structure in which an update finds the boxes of the last one.

/// The one structure that holds all boxes as of the last update. The next update reads no other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Holder {
    #[default]
    Nothing,
    /// The lanes of a sweep.
    Lanes,
    Grid,
    Tree,
}
