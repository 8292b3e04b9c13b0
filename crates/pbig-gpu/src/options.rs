//! The settings of the device. Every field says its unit, why one would change it, and what follows.

use std::time::Duration;

/// The settings of the GPU backend. The defaults suit most programs. A later version may have more settings: end
/// with `..GpuOptions::DEFAULT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpuOptions {
    /// If true, a piece of a long list comes while threads take the one before (PBIG table IV, "pipelining").
    pub pipelining: bool,
    /// If true, the rows of a large cell get equally many pairs (PBIG table IV, "load balancing").
    pub load_balancing: bool,
    /// Number of small and of large work items of a submission. They have at most 256 and 524,288 tests each. Longer
    /// submissions may exceed the time limit of some systems.
    pub chunk: [u32; 2],
    /// Largest buffer and binding in bytes, at least 2^20. The device may allow less. A call that needs a larger one is the CPU's.
    pub max_bytes: u64,
    /// Largest size of all buffers of a finder together, in bytes; once more for boxes that live on the device. A call that needs more
    /// is the CPU's: a device without memory fails, and one that shares the system's makes it page.
    pub max_total_bytes: u64,
    /// Bytes for each box, in the first call, of the lists whose lengths only the device knows. With less than they need the
    /// call begins anew.
    pub first_bytes: u64,
    /// Longest time that a call waits for a submission of checks or of sorting before it finishes on the CPU. A device that hangs
    /// costs this time for each one that the call waits for, mostly one, and after it `pause`: a game sets less, a batch on a device
    /// that others use sets more.
    pub patience: Duration,
    /// Time for which calls stay on the CPU after the device failed.
    pub pause: Duration,
    /// Wanted boxes per cell: PBIG's `W` in the constraint `f >= W` of equation 6. More boxes make larger cells. The paper
    /// takes a warp, 32.
    pub boxes_per_cell: f32,
    /// Maximum number of boxes of a cell, up to 256, whose pairs are tested through Avril's mapping. Larger cells are
    /// tested by PBIG's balanced rows.
    pub small_cell: u32,
    /// Maximum number of boxes of a set whose pairs are all tested, without a grid. 0: there is always a grid. Values above 32,768
    /// count as 32,768. Avril's table 7 puts the crossover at 1000.
    pub all_pairs_up_to: u32,
    /// If true, the device counts the tests that it makes, those that repeat another and those of boxes that are apart. It
    /// costs four more atomic operations for each workgroup.
    pub count_tests: bool,
    /// If true, the device measures the time of each kernel, the first 2048 of a call, where it can. It then finishes one before the
    /// next begins, and recording takes the host twice as long.
    pub time_kernels: bool,
}

impl GpuOptions {
    /// The defaults.
    pub const DEFAULT: Self = Self {
        pipelining: true,
        load_balancing: true,
        chunk: [1 << 18, 1 << 12],
        max_bytes: u64::MAX,
        max_total_bytes: 8 << 30,
        first_bytes: 16,
        patience: Duration::from_secs(30),
        pause: Duration::from_secs(5),
        boxes_per_cell: 4.0,
        small_cell: 96,
        all_pairs_up_to: 1024,
        count_tests: false,
        time_kernels: false,
    };
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self::DEFAULT
    }
}
