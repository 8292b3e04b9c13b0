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

/// PBIG, table IV, with the totals of table VI in ms: the setting (C: data compression, P: pipelined execution, B: load balancing),
/// the speed-up, and the total.
pub(super) const TABLE_IV: [(&str, Option<f64>, f64); 8] = [
    ("baseline", None, 10_264.94),
    ("+C", Some(1.86), 5512.054),
    ("+P", Some(1.98), 5181.014),
    ("+C+P", Some(2.63), 3891.116),
    ("+B", Some(1.01), 10_167.36),
    ("+C+B", Some(2.88), 3562.59),
    ("+P+B", Some(1.92), 5337.236),
    ("+C+P+B", Some(4.81), 2132.998),
];

/// Avril, table 2: objects, milliseconds with the square root and the "lazy way" without.
pub(super) const AVRIL_2: [(u64, f64, f64); 3] =
    [(1000, 0.21, 0.25), (10_000, 2.25, 4.28), (100_000, 29.66, 58.24)];

/// Avril, table 3: numbers; wrong roots in percent by Carmack's constant, with two steps and with three.
pub(crate) const AVRIL_3: [(u32, [f64; 2]); 6] = [
    (1000, [2.9, 0.7]),
    (10_000, [0.89, 0.12]),
    (100_000, [0.27, 0.035]),
    (1_000_000, [0.18, 0.011]),
    (10_000_000, [0.3681, 0.004]),
    (100_000_000, [0.9847, 0.0134]),
];

/// Avril, table 4: roots; milliseconds by Carmack's approximation and by CUDA's own root.
pub(crate) const AVRIL_4: [(u32, [f64; 2]); 4] = [
    (1_000_000, [0.042, 0.048]),
    (10_000_000, [0.409, 0.478]),
    (100_000_000, [4.102, 4.722]),
    (1_000_000_000, [41.01, 48.01]),
];

/// Avril, table 6: objects; milliseconds of a step.
pub(super) const AVRIL_6: [(usize, f64); 4] =
    [(1000, 0.25), (10_000, 2.35), (100_000, 27.91), (1_000_000, 291.89)];

/// Avril, table 7: objects; milliseconds without the grid and with it.
pub(super) const AVRIL_7: [(usize, f64, f64); 3] =
    [(100, 0.046, 1.020), (1000, 0.872, 1.840), (10_000, 31.450, 3.257)];
