//! The numbers that the two papers print, each with its place. *PBIG*: Lo et al. 2013. *Avril*: Avril et al. 2012.
//! The figures are drawings without numbers; of them only what the text says is here.

/// PBIG 6.1: edge of the cubic space.
pub(super) const SPACE: f64 = 1e4;
/// PBIG 6.1: the length of a box in each dimension is uniform in this interval.
pub(super) const LENGTHS: [f64; 2] = [1.0, 100.0];
/// PBIG 6.3: mean and standard deviation of the centres.
pub(super) const NORMAL: [f64; 2] = [5000.0, 1000.0];
/// PBIG 6.1, 6.2, 6.4: most boxes.
pub(super) const MOST_BOXES: usize = 10_000_000;
/// PBIG 6.4: bytes of the pairs of 10^7 boxes with normal centres, "GB".
pub(super) const GAUSSIAN_GB: f64 = 8.968;
/// PBIG 4.1 and 6: threads of a warp, `W` of equation 6.
pub(super) const WARP: f64 = 32.0;
/// PBIG 6.1: lengths of the cells of figure 9, beside that of equation 6.
pub(super) const CELLS: [f64; 5] = [64.0, 128.0, 256.0, 512.0, 1024.0];
/// A row of PBIG's table III, for 10^7 boxes.
pub(super) struct Coverage {
    pub(super) doc: f64,
    pub(super) pairs: u64,
    pub(super) checks: u64,
    /// "MB"
    pub(super) output: f64,
    /// Length of a cell, where section 6.2 says it.
    pub(super) cell: Option<f64>,
}

/// PBIG, table III.
pub(super) const TABLE_III: [Coverage; 5] = [
    Coverage { doc: 0.001, pairs: 6_234, checks: 879_000_000, output: 0.024, cell: None },
    Coverage { doc: 0.01, pairs: 50_064, checks: 930_000_000, output: 0.183, cell: None },
    Coverage { doc: 0.1, pairs: 530_689, checks: 1_062_000_000, output: 1.334, cell: Some(256.0) },
    Coverage { doc: 1.0, pairs: 5_165_837, checks: 286_000_000, output: 9.369, cell: Some(128.0) },
    Coverage { doc: 10.0, pairs: 49_514_252, checks: 744_000_000, output: 44.734, cell: Some(128.0) },
];

/// A row of PBIG's tables IV and VI, in microseconds (section 6.4 calls 1,941,184 of them 1.941 seconds).
pub(super) struct Timing {
    /// C: data compression, P: pipelined execution, B: load balancing.
    pub(super) setting: &'static str,
    pub(super) speed_up: Option<f64>,
    pub(super) total: u64,
    /// `DataIn`, PLAN, MAP, SCHED, CHECK, `DataOut`, REPORT; with pipelining one number for the last three.
    pub(super) tasks: &'static [u64],
}

const fn timing(setting: &'static str, speed_up: Option<f64>, total: u64, tasks: &'static [u64]) -> Timing {
    Timing { setting, speed_up, total, tasks }
}

/// PBIG, tables IV and VI.
pub(super) const TABLE_VI: [Timing; 8] = [
    timing("baseline", None, 10_264_940, &[50_423, 30, 137_909, 2_644, 4_970_496, 1_740_208, 3_312_812]),
    timing("+C", Some(1.86), 5_512_054, &[52_686, 35, 137_713, 2_709, 3_806_897, 473_857, 995_124]),
    timing("+P", Some(1.98), 5_181_014, &[48_470, 28, 137_649, 2_753, 4_983_314]),
    timing("+C+P", Some(2.63), 3_891_116, &[49_243, 30, 137_845, 2_684, 3_697_194]),
    timing("+B", Some(1.01), 10_167_360, &[49_926, 31, 137_854, 2_701, 5_039_146, 1_696_377, 3_191_348]),
    timing("+C+B", Some(2.88), 3_562_590, &[54_857, 39, 137_996, 3_193, 2_097_496, 483_593, 740_671]),
    timing("+P+B", Some(1.92), 5_337_236, &[48_115, 41, 137_856, 2_837, 5_139_588]),
    timing("+C+P+B", Some(4.81), 2_132_998, &[47_760, 35, 137_840, 2_537, 1_941_184]),
];

/// PBIG, table V: the tasks. Ours: `DeviceReport::upload`; `StageTimes::plan` on the host; the kernels `locate` to `scan_add` and
/// `scatter`; `schedule` and `arrange`; `check_*`; `DeviceReport::wait` less the kernels; `DeviceReport::decode` and emit.
pub(super) const TASKS: [&str; 7] = ["DataIn", "PLAN", "MAP", "SCHED", "CHECK", "DataOut", "REPORT"];

/// Avril, table 2: objects, milliseconds with the square root and the "lazy way" without.
pub(super) const AVRIL_2: [(u64, f64, f64); 3] =
    [(1000, 0.21, 0.25), (10_000, 2.25, 4.28), (100_000, 29.66, 58.24)];

/// A row of Avril's table 4.
pub(crate) struct Roots {
    pub(crate) roots: u64,
    /// Milliseconds by Carmack's or Lomont's approximation, which it has the same for both.
    pub(crate) approximate: f64,
    /// Milliseconds of CUDA's own.
    pub(crate) cuda: f64,
}

/// Avril, table 4.
pub(crate) const AVRIL_4: [Roots; 4] = [
    Roots { roots: 1_000_000, approximate: 0.042, cuda: 0.048 },
    Roots { roots: 10_000_000, approximate: 0.409, cuda: 0.478 },
    Roots { roots: 100_000_000, approximate: 4.102, cuda: 4.722 },
    Roots { roots: 1_000_000_000, approximate: 41.01, cuda: 48.01 },
];

/// Avril, table 5: objects; kernel (ms) and output (microseconds) with a byte a pair, and with a bit.
pub(super) const AVRIL_5: [(u64, [f64; 2], [f64; 2]); 4] = [
    (100, [0.03, 14.35], [0.03, 7.75]),
    (1000, [2.70, 842.75], [2.72, 111.18]),
    (5000, [73.95, 21_428.0], [74.14, 2612.42]),
    (7500, [163.60, 45_865.94], [162.03, 5687.20]),
];

/// Avril, table 6: objects; milliseconds of the update of boxes, of the grid, of brute force, in all.
pub(super) const AVRIL_6: [(usize, [f64; 4]); 4] = [
    (1000, [0.03, 0.13, 0.09, 0.25]),
    (10_000, [0.31, 1.45, 0.59, 2.35]),
    (100_000, [3.38, 11.12, 13.41, 27.91]),
    (1_000_000, [14.26, 134.91, 142.72, 291.89]),
];

/// Avril, table 7: objects; milliseconds without the grid and with it.
pub(super) const AVRIL_7: [(usize, f64, f64); 3] =
    [(100, 0.046, 1.020), (1000, 0.872, 1.840), (10_000, 31.450, 3.257)];
