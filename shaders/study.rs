//! Kernels that only tests run: Avril's mapping from indices to pairs, and the lazy way beside it.

use crate::{PAIR_INDEX, kernels};

const LAZY: &str = include_str!("study/shared/lazy.wgsl");

kernels! {
    /// Every kernel that only tests run.
    in "study/";
    /// Computes the pairs of given indices.
    INDEX_PAIRS "index_pairs" [PAIR_INDEX] (Params, Out);
    /// Computes the pairs of given identifiers, by the lazy way.
    LAZY_PAIRS "lazy_pairs" [LAZY] (Params, Out);
    /// Computes the pairs at the ends of rows, for many numbers of boxes.
    ROW_ENDS "row_ends" [PAIR_INDEX] (Params, Out);
    /// Computes the pairs at the ends of rows and at the diagonal, by the lazy way.
    LAZY_ENDS "lazy_ends" [LAZY] (Params, Out);
}
