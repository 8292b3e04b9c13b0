//! The GPU kernels of pbig: one WGSL file each. File, entry point, stage in reports and label in a GPU debugger have the
//! same name.
//!
//! A kernel's file declares its bindings, in the order of [`Kernel::bindings`]. Code that kernels share is in `shared/`
//! and goes in front of it. This crate knows no device: whoever has one compiles [`Kernel::source`].
//!
//! ```
//! let locate = pbig_shaders::LOCATE;
//! assert_eq!(locate.name, "locate");
//! assert!(locate.source(false, false).contains("fn locate("));
//! ```

/// Runs the program in the README as a test.
#[cfg(doctest)]
#[doc = include_str!("README.md")]
struct Readme;

pub mod study;

/// A buffer that kernels bind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Buffer {
    /// Parameters of a call.
    Params,
    /// The range of work items of a submission.
    Chunk,
    /// Boxes; in a search for changes also as they were at the last update.
    Boxes,
    /// Filters of the boxes.
    Filters,
    /// Boxes that have changed since the last update.
    BoxChanges,
    /// Filters that have changed since the last update.
    FilterChanges,
    /// Cells and level of each box.
    Located,
    /// Entries of each cell: counts, then ends of its lists.
    Cells,
    /// First entry of each cell.
    Starts,
    /// Entries of each block of cells.
    Sums,
    /// Lengths of the lists that the device makes.
    Counters,
    /// Small cells with work.
    Slots,
    /// Work items of small cells.
    SmallItems,
    /// Work items of large cells.
    LargeItems,
    /// Boxes of all cells.
    Entries,
    /// Sizes of indirect dispatches.
    Dispatches,
    /// Counts of the checks.
    Totals,
    /// Pairs.
    Out,
}

impl Buffer {
    /// Returns the name of the variable in WGSL, which is also the label in a GPU debugger.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Params => "params",
            Self::Chunk => "chunk",
            Self::Boxes => "boxes",
            Self::Filters => "filters",
            Self::BoxChanges => "box_changes",
            Self::FilterChanges => "filter_changes",
            Self::Located => "located",
            Self::Cells => "cells",
            Self::Starts => "starts",
            Self::Sums => "sums",
            Self::Counters => "counters",
            Self::Slots => "slots",
            Self::SmallItems => "small_items",
            Self::LargeItems => "large_items",
            Self::Entries => "entries",
            Self::Dispatches => "dispatches",
            Self::Totals => "totals",
            Self::Out => "out",
        }
    }

    /// Returns true if kernels bind the buffer as a uniform.
    pub const fn is_uniform(self) -> bool {
        matches!(self, Self::Params | Self::Chunk)
    }
}

/// A kernel: its name, the buffers that it binds, and its text.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Kernel {
    /// Name of the file, entry point, stage and label.
    pub name: &'static str,
    /// Buffers of group 0, by binding number.
    pub bindings: &'static [Buffer],
    parts: &'static [&'static str],
    body: &'static str,
}

impl Kernel {
    /// Returns the whole WGSL text, for devices with or without subgroups, and for a search for changes or for all
    /// overlaps.
    pub fn source(&self, subgroups: bool, changes: bool) -> String {
        let part = |&part: &&'static str| match part {
            BLOCK_SCAN if subgroups => BLOCK_SCAN_SUBGROUPS,
            SEARCH_OVERLAPS if changes => SEARCH_CHANGES,
            part => part,
        };
        let parts = self.parts.iter().map(part);
        // The standard asks for `enable subgroups`. naga 30 does not know that, nor does it need it.
        [TYPES].into_iter().chain(parts).chain([self.body]).collect::<Vec<_>>().join("\n")
    }

    /// Returns true if there is a faster text for devices with subgroups.
    pub fn gains_from_subgroups(&self) -> bool {
        self.parts.contains(&BLOCK_SCAN)
    }

    /// Returns true if a search for changes has a text of its own.
    pub fn depends_on_search(&self) -> bool {
        self.parts.contains(&SEARCH_OVERLAPS)
    }
}

const TYPES: &str = include_str!("shared/types.wgsl");
const CELLS: &str = include_str!("shared/cells.wgsl");
const BLOCK_SCAN: &str = include_str!("shared/block_scan.wgsl");
const BLOCK_SCAN_SUBGROUPS: &str = include_str!("shared/block_scan_subgroups.wgsl");
const PAIR_INDEX: &str = include_str!("shared/pair_index.wgsl");
const SEARCH_OVERLAPS: &str = include_str!("shared/search_overlaps.wgsl");
const SEARCH_CHANGES: &str = include_str!("shared/search_changes.wgsl");
const EMIT: &str = include_str!("shared/emit.wgsl");

/// Declares kernels, each once, with the list of all.
macro_rules! kernels {
    ($(#[$all:meta])* in $folder:literal; $($(#[$doc:meta])* $constant:ident $name:literal [$($part:ident),*]
        ($($binding:ident),*);)*) => {
        $($(#[$doc])* pub const $constant: $crate::Kernel = $crate::Kernel {
            name: $name,
            bindings: &[$($crate::Buffer::$binding),*],
            parts: &[$($part),*],
            body: include_str!(concat!($folder, $name, ".wgsl")),
        };)*

        $(#[$all])*
        pub const KERNELS: &[&$crate::Kernel] = &[$(&$constant),*];
    };
}
pub(crate) use kernels;

kernels! {
    /// Every kernel of a search, in the order in which they run.
    in "";
    /// Changes: stores each box as the box at the last update.
    STORE_PREVIOUS "store_previous" [] (Params, Boxes);
    /// Changes: applies the changes of boxes and filters.
    APPLY_CHANGES "apply_changes" [] (Params, BoxChanges, FilterChanges, Boxes, Filters);
    /// Map: computes the cells and the level of each box, and counts the residents of each cell.
    LOCATE "locate" [SEARCH_OVERLAPS, CELLS] (Params, Boxes, Located, Cells);
    /// Map: counts the visitors of each cell.
    VISIT "visit" [CELLS] (Params, Located, Cells);
    /// Map: computes prefix sums within blocks of cells.
    SCAN_BLOCKS "scan_blocks" [BLOCK_SCAN] (Params, Cells, Starts, Sums);
    /// Map: computes prefix sums over the blocks.
    SCAN_SUMS "scan_sums" [BLOCK_SCAN] (Params, Sums, Counters);
    /// Map: adds both, and computes where the scatter begins.
    SCAN_ADD "scan_add" [] (Params, Sums, Starts, Cells);
    /// Schedule: turns cells into work items.
    SCHEDULE "schedule" [BLOCK_SCAN] (Params, Cells, Starts, Slots, SmallItems, LargeItems, Counters);
    /// Map: scatters boxes into cells.
    SCATTER "scatter" [CELLS] (Params, Located, Starts, Counters, Cells, Entries);
    /// Schedule: computes the sizes of the dispatches that follow.
    ARRANGE "arrange" [] (Params, Chunk, Counters, Dispatches);
    /// Check: tests the pairs of small cells.
    CHECK_SMALL "check_small" [SEARCH_OVERLAPS, BLOCK_SCAN, PAIR_INDEX, EMIT]
        (Params, Chunk, Boxes, Filters, Entries, Counters, Slots, SmallItems, Totals, Out);
    /// Check: tests the pairs of large cells.
    CHECK_LARGE "check_large" [SEARCH_OVERLAPS, EMIT]
        (Params, Chunk, Boxes, Filters, Entries, Counters, LargeItems, Totals, Out);
    /// Check: tests all pairs, without a grid.
    CHECK_ALL "check_all" [SEARCH_OVERLAPS, PAIR_INDEX, EMIT] (Params, Chunk, Boxes, Filters, Totals, Out);
}
