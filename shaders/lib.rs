//! The GPU kernels of pbig: one WGSL file each. File, entry point, time in reports and label in a GPU debugger have the
//! same name.
//!
//! A kernel's file declares its bindings, in the order of [`Kernel::bindings`]. Code that kernels share is in `shared/`
//! and goes in front of it. This crate knows no device: whoever has one compiles [`Kernel::source`].
//!
//! ```
//! let locate = pbig_shaders::LOCATE;
//! assert_eq!(locate.name, "locate");
//! assert!(locate.source().contains("fn locate("));
//! ```

/// Runs the program in the README as a test.
#[cfg(doctest)]
#[doc = include_str!("README.md")]
struct Readme;

/// Declares [`Buffer`]: each buffer once, with its name.
macro_rules! buffers {
    ($($(#[$doc:meta])* $buffer:ident $name:literal;)*) => {
        /// A buffer that kernels bind.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Buffer { $($(#[$doc])* $buffer),* }

        impl Buffer {
            /// Returns the name of the variable in WGSL, which is also the label in a GPU debugger.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$buffer => $name),* }
            }
        }
    };
}

buffers! {
    /// Parameters of a call.
    Params "params";
    /// The range of work items of a submission.
    Chunk "chunk";
    /// Boxes.
    Boxes "boxes";
    /// Filters of the boxes.
    Filters "filters";
    /// Cells and level of each box.
    Located "located";
    /// Entries of each cell: counts, then ends of its lists, then their starts.
    Cells "cells";
    /// Entries in the blocks before each block of cells, or pairs before each block of rows.
    Sums "sums";
    /// Lengths of the lists that the device makes.
    Counters "counters";
    /// Small cells with work.
    Slots "slots";
    /// Work items of small cells.
    SmallItems "small_items";
    /// Work items of large cells.
    LargeItems "large_items";
    /// Boxes of all cells.
    Entries "entries";
    /// Sizes of indirect dispatches.
    Dispatches "dispatches";
    /// Counts of the checks.
    Totals "totals";
    /// Pairs.
    Out "out";
    /// Pairs of each first box: counts, then ends, then starts.
    Rows "rows";
    /// Pairs by first box.
    Grouped "grouped";
    /// Size of the indirect dispatch for the pieces of long rows, and these pieces. The kernel that lists them is dispatched
    /// indirectly itself, and may not write what it is dispatched from.
    LongRows "long_rows";
    /// Number of pairs in each window of the long rows.
    Windows "windows";
    /// Sizes of boxes that live on the device, and a sample of them.
    Summary "summary";
    /// Number of pairs that stay on the device, and whether they are all.
    PairCount "pair_count";
}

impl Buffer {
    /// Returns true if kernels bind the buffer as a uniform.
    pub const fn is_uniform(self) -> bool {
        matches!(self, Self::Params | Self::Chunk)
    }
}

/// The part of a search to which a kernel's time belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Sorting boxes into cells, and cells into work items.
    Map,
    /// Testing pairs.
    Check,
    /// Sorting the pairs that were found.
    Sort,
}

/// A kernel: its name, its stage, the buffers that it binds, and its text.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Kernel {
    /// Name of the file, entry point and label.
    pub name: &'static str,
    /// The stage.
    pub stage: Stage,
    /// Buffers of group 0, by binding number.
    pub bindings: &'static [Buffer],
    /// True if the override `ROWS` is set.
    pub scans_rows: bool,
    parts: &'static [&'static str],
    body: &'static str,
}

impl Kernel {
    /// Returns the whole WGSL text.
    pub fn source(&self) -> String {
        let parts = self.parts.iter().copied();
        [TYPES].into_iter().chain(parts).chain([self.body]).collect::<Vec<_>>().join("\n")
    }
}

const TYPES: &str = include_str!("shared/types.wgsl");
const FLOATS: &str = include_str!("shared/floats.wgsl");
const CELLS: &str = include_str!("shared/cells.wgsl");
const FITS: &str = include_str!("shared/fits.wgsl");
const SCANNED: &str = include_str!("shared/scanned.wgsl");
const ENDS: &str = include_str!("shared/ends.wgsl");
const ROWS: &str = include_str!("shared/rows.wgsl");
const LEADERS: &str = include_str!("shared/leaders.wgsl");
const PIECES: &str = include_str!("shared/pieces.wgsl");
const BLOCK_SCAN: &str = include_str!("shared/block_scan.wgsl");
const PAIR_INDEX: &str = include_str!("shared/pair_index.wgsl");
const EMIT: &str = include_str!("shared/emit.wgsl");

/// Declares kernels, each once, and [`KERNELS`].
macro_rules! kernels {
    ($($(#[$doc:meta])* $constant:ident $stage:ident $name:literal [$($part:ident),*]
        ($($binding:ident),*);)*) => {
        $($(#[$doc])* pub const $constant: Kernel = Kernel {
            name: $name,
            stage: Stage::$stage,
            bindings: &[$(Buffer::$binding),*],
            scans_rows: false,
            parts: &[$($part),*],
            body: include_str!(concat!($name, ".wgsl")),
        };)*

        /// Every kernel of a search, in the order in which they run.
        pub const KERNELS: &[&Kernel] = &[$(&$constant),*];
    };
}

kernels! {
    /// Plan: measures boxes that live on the device.
    MEASURE Map "measure" [FLOATS] (Params, Boxes, Summary);
    /// Map: computes the cells and the level of each box, and counts the residents of each cell.
    LOCATE Map "locate" [FLOATS, CELLS] (Params, Boxes, Located, Cells, Counters);
    /// Map: counts the visitors of each cell.
    VISIT Map "visit" [CELLS] (Params, Located, Cells);
    /// Scan: computes prefix sums within blocks of lists.
    SCAN_BLOCKS Map "scan_blocks" [SCANNED, BLOCK_SCAN] (Params, Cells, Sums);
    /// Scan: computes prefix sums over the blocks.
    SCAN_SUMS Map "scan_sums" [SCANNED, BLOCK_SCAN] (Params, Sums, Counters);
    /// Schedule: turns cells into work items.
    SCHEDULE Map "schedule" [ENDS, BLOCK_SCAN] (Params, Cells, Sums, Slots, SmallItems, LargeItems, Counters);
    /// Map: scatters boxes into cells.
    SCATTER Map "scatter" [ENDS, CELLS] (Params, Located, Sums, Counters, Cells, Entries);
    /// Schedule: computes the sizes of the dispatches that follow.
    ARRANGE Map "arrange" [FITS] (Params, Chunk, Counters, Dispatches);
    /// Check: tests the pairs of small cells.
    CHECK_SMALL Check "check_small" [FLOATS, PAIR_INDEX, EMIT]
        (Params, Chunk, Boxes, Filters, Entries, Counters, Slots, SmallItems, Totals, Out);
    /// Check: tests the pairs of large cells.
    CHECK_LARGE Check "check_large" [FLOATS, EMIT]
        (Params, Chunk, Boxes, Filters, Entries, Counters, LargeItems, Totals, Out);
    /// Check: tests all pairs, without a grid.
    CHECK_ALL Check "check_all" [FLOATS, PAIR_INDEX, EMIT] (Params, Chunk, Boxes, Filters, Totals, Out);
    /// Check: says how many pairs stay on the device, and whether they are all.
    CONCLUDE Check "conclude" [FITS] (Params, Chunk, Counters, Totals, PairCount);
    /// Sort: counts the pairs of each first box.
    COUNT_PAIRS Sort "count_pairs" [LEADERS] (Totals, Out, Rows);
    /// Sort: groups the pairs by first box.
    PLACE_PAIRS Sort "place_pairs" [ENDS, LEADERS] (Totals, Out, Sums, Rows, Grouped);
    /// Sort: orders short rows, and cuts long ones into pieces.
    RANK_PAIRS Sort "rank_pairs" [ENDS, ROWS]
        (Params, Chunk, Totals, Sums, Rows, Grouped, LongRows, Windows, Out);
    /// Sort: groups the pairs of long rows by window.
    PLACE_WINDOWS Sort "place_windows" [ROWS, PIECES, BLOCK_SCAN] (Params, Grouped, LongRows, Windows, Out);
    /// Sort: orders the windows of long rows.
    RANK_WINDOWS Sort "rank_windows" [ROWS, PIECES, BLOCK_SCAN] (Params, Grouped, LongRows, Windows, Out);
}

/// Sort: the scan, of the rows of pairs instead of the cells.
pub const SCAN_OF_ROWS: &[&Kernel; 2] = &[
    &Kernel { bindings: &[Buffer::Params, Buffer::Rows, Buffer::Sums], scans_rows: true, ..SCAN_BLOCKS },
    &Kernel { scans_rows: true, ..SCAN_SUMS },
];

/// For tests: computes the pairs of given indices.
#[doc(hidden)]
pub const INDEX_PAIRS: Kernel = Kernel {
    name: "index_pairs",
    stage: Stage::Map,
    bindings: &[Buffer::Params, Buffer::Out],
    scans_rows: false,
    parts: &[PAIR_INDEX],
    body: include_str!("tests/index_pairs.wgsl"),
};
