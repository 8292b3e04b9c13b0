//! The GPU kernels of pbig: one WGSL file each, named like its entry point, its stage in reports and
//! its label in a GPU debugger.
//!
//! A kernel's file declares its bindings, in the order of [`Kernel::bindings`]; what kernels share is
//! in `shared/` and put in front of it. Nothing here knows of a device: whoever has one compiles
//! [`Kernel::source`].
//!
//! ```
//! let locate = pbig_shaders::LOCATE;
//! assert_eq!(locate.name, "locate");
//! assert!(locate.source(false, false).contains("fn locate("));
//! ```

/// A kernel: what it is called, which buffers it binds in which order, and its text.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Kernel {
    /// The name of its file, entry point, stage and label.
    pub name: &'static str,
    /// The buffers of group 0, by binding number; the names are those of the variables in the text.
    pub bindings: &'static [&'static str],
    parts: &'static [&'static str],
    body: &'static str,
}

impl Kernel {
    /// The whole WGSL text, with the scan that uses subgroups where the device has them, and for a
    /// search for overlaps or for changes.
    pub fn source(&self, subgroups: bool, changes: bool) -> String {
        let part = |&part: &&'static str| match part {
            BLOCK_SCAN if subgroups => BLOCK_SCAN_SUBGROUPS,
            OVERLAPS if changes => CHANGES,
            part => part,
        };
        let parts = self.parts.iter().map(part);
        // Without the standard's `enable subgroups`, which naga 30 does not know and does not ask for.
        [TYPES].into_iter().chain(parts).chain([self.body]).collect::<Vec<_>>().join("\n")
    }

    /// Whether there is a faster text for devices with subgroups.
    pub fn gains_from_subgroups(&self) -> bool {
        self.parts.contains(&BLOCK_SCAN)
    }

    /// Whether the text of a search for changes is another than that of a search for overlaps.
    pub fn tells_changes(&self) -> bool {
        self.parts.contains(&OVERLAPS)
    }
}

const TYPES: &str = include_str!("shared/types.wgsl");
const CELLS: &str = include_str!("shared/cells.wgsl");
const BLOCK_SCAN: &str = include_str!("shared/block_scan.wgsl");
const BLOCK_SCAN_SUBGROUPS: &str = include_str!("shared/block_scan_subgroups.wgsl");
const PAIR_INDEX: &str = include_str!("shared/pair_index.wgsl");
const LAZY: &str = include_str!("shared/lazy.wgsl");
const OVERLAPS: &str = include_str!("shared/overlaps.wgsl");
const CHANGES: &str = include_str!("shared/changes.wgsl");
const EMIT: &str = include_str!("shared/emit.wgsl");

/// Declares each kernel once, in the order in which they run.
macro_rules! kernels {
    ($($(#[$doc:meta])* $constant:ident $name:literal [$($part:ident),*] ($($binding:ident),*);)*) => {
        $($(#[$doc])* pub const $constant: Kernel = Kernel {
            name: $name,
            bindings: &[$(stringify!($binding)),*],
            parts: &[$($part),*],
            body: include_str!(concat!($name, ".wgsl")),
        };)*

        /// Every kernel, in the order in which they run.
        pub const KERNELS: &[&Kernel] = &[$(&$constant),*];
    };
}

kernels! {
    /// Changes: what boxes are becomes what they were.
    SETTLE "settle" [] (params, boxes);
    /// Changes: boxes and filters that have changed.
    RENEW "renew" [] (params, moves, refilters, boxes, filters);
    /// Map: the cells of each box, its level, residents of each cell.
    LOCATE "locate" [OVERLAPS, CELLS] (params, boxes, located, cells);
    /// Map: visitors of each cell.
    VISIT "visit" [CELLS] (params, located, cells);
    /// Map: prefix sums within blocks of cells.
    SCAN_BLOCKS "scan_blocks" [BLOCK_SCAN] (params, cells, starts, sums);
    /// Map: prefix sums of the blocks.
    SCAN_SUMS "scan_sums" [BLOCK_SCAN] (params, sums, counters);
    /// Map: both together, and cursors for the scatter.
    SCAN_ADD "scan_add" [] (params, sums, starts, cells);
    /// Schedule: cells become work items.
    SCHEDULE "schedule" [BLOCK_SCAN] (params, cells, starts, slots, small_items, large_items, counters);
    /// Map: boxes into cells.
    SCATTER "scatter" [CELLS] (params, located, starts, counters, cells, entries);
    /// Schedule: the size of the dispatches that follow.
    ARRANGE "arrange" [] (params, chunk, counters, dispatches);
    /// Check: small cells.
    CHECK_SMALL "check_small" [OVERLAPS, BLOCK_SCAN, PAIR_INDEX, EMIT]
        (params, chunk, boxes, filters, entries, counters, slots, small_items, totals, out);
    /// Check: large cells.
    CHECK_LARGE "check_large" [OVERLAPS, EMIT]
        (params, chunk, boxes, filters, entries, counters, large_items, totals, out);
    /// Check: all pairs, without a grid.
    CHECK_ALL "check_all" [OVERLAPS, PAIR_INDEX, EMIT] (params, chunk, boxes, filters, totals, out);
    /// Study: pairs of given indices.
    INDEX_PAIRS "index_pairs" [PAIR_INDEX] (params, out);
    /// Study: pairs of given identifiers, by the lazy way.
    LAZY_PAIRS "lazy_pairs" [LAZY] (params, out);
    /// Study: pairs at the ends of the rows of many numbers of boxes.
    ROW_ENDS "row_ends" [PAIR_INDEX] (params, out);
    /// Study: the same by the lazy way, and about the diagonal.
    LAZY_ENDS "lazy_ends" [LAZY] (params, out);
}
