//! The errors. Each message says what to do about it. It names a limit by its field alone, which is the same in [`crate::Limits`]
//! and in the settings of the adapters.

/// The reason why a call could not be completed. There is no partial result beside an error.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// More boxes than [`crate::Limits::max_boxes`], or an id beyond it.
    #[error("{boxes} boxes are more than max_boxes = {limit}; raise it or split the set")]
    TooManyBoxes {
        /// Boxes asked for: the length of the list, or the id plus one.
        boxes: u64,
        /// The limit in force.
        limit: u64,
    },
    /// An id so far above the known ones that the tables by id would be nearly empty.
    #[error("id {id} is far above the {known} ids known so far; number boxes densely from 0")]
    SparseId {
        /// The id asked for.
        id: u32,
        /// One more than the largest id known so far.
        known: u32,
    },
    /// More pairs than [`crate::Limits::max_pairs`].
    #[error(
        "more than max_pairs = {limit} overlapping pairs; raise it (8 bytes a pair) or search fewer boxes"
    )]
    TooManyPairs {
        /// The limit in force.
        limit: u64,
    },
    /// The lists of boxes and filters have different lengths.
    #[error("{filters} filters for {boxes} boxes: give one filter for each box")]
    FilterCount {
        /// Length of the list of boxes.
        boxes: usize,
        /// Length of the list of filters.
        filters: usize,
    },
    /// [`crate::Boxes`] have other numbers of boxes and of keys.
    #[error("{keys} entries of keys for {boxes} boxes: give one entry for each box")]
    KeyCount {
        /// Length of the list of boxes.
        boxes: usize,
        /// Length of the list of keys.
        keys: usize,
    },
    /// A margin that is negative, infinite or NaN.
    #[error("margin {margin} is not a finite length of at least 0")]
    Margin {
        /// The margin that was given.
        margin: f32,
    },
}
