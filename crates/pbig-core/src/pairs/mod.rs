//! Pairs: found ones sorted by `(a, b)`, kept ones in rows, and the comparison of the two.
//!
//! ```text
//! hits of each thread ─► groups of `a` ─► sorted rows ─► list, or: compared with the kept rows ─► events
//! ```

mod compare;
mod groups;
mod kept;
mod row;

pub(crate) use compare::{Comparison, Differences};
pub(crate) use groups::{Found, Grouping, Groups};
pub(crate) use kept::Kept;
pub(crate) use row::{differences, equal, sort_few};
