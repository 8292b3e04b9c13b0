//! The frame that suites and studies share: box sets, times in turn, tables, reports, failures.

pub use crate::bench::{COMPARED, Effort, MS, Took, alone, compared, measured, medians, timed, unprepared};
pub use crate::boxes::{BoxSet, moved};
pub use crate::cells;
pub use crate::output::{Failure, check, print, progress, tracked};
pub use crate::report::BenchReport;
pub use crate::runner::{Spread, milliseconds};
pub use crate::table::{Table, Value};
