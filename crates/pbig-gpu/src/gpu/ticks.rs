//! Ticks: the integers from which a device computes cells (contract 3). A tick is a power of two, so a device gets a coordinate's
//! ticks by shifting the bits of its float, without floating-point arithmetic. That need not be the same at two places of a
//! kernel: Metal's compiler may contract, reorder and flush it.

/// Binary logarithm of the fewest ticks of a cell, unless the world reaches too far. Cells are whole ticks, so they differ by one.
const TICKS_PER_CELL_LOG2: i32 = 3;
/// Binary logarithm of the number of ticks from zero to the end of most boxes. Kernels reach twice as far.
const REACH_LOG2: i32 = 29;
/// Exponent in the bits of a float whose last bit is 1.
const EXPONENT_OF_ONE: i32 = 150;

/// The size of a tick, and of a cell in ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ticks {
    /// Exponent in the bits of the floats whose last bit is a tick.
    pub(super) exponent: i32,
    /// Number of cells in 2^16 ticks, at most 2^16.
    pub(super) cells_per_tick: u32,
    /// Edge of a cell, in the boxes' length unit.
    pub(super) cell: f64,
}

impl Ticks {
    /// Returns ticks for cells of at least this edge, where most boxes lie within `reach` of zero.
    pub(super) fn new(edge: f64, reach: f64) -> Self {
        let edge = edge.clamp(1e-30, 1e30);
        let exponent = (log2(edge) - TICKS_PER_CELL_LOG2).max(log2(reach) + 1 - REACH_LOG2);
        let ticks = f64::from(1 << 16) * power(exponent);
        let cells_per_tick = (ticks / edge).min(f64::from(1 << 16)) as u32;
        Self { exponent: exponent + EXPONENT_OF_ONE, cells_per_tick, cell: ticks / f64::from(cells_per_tick) }
    }
}

/// Returns the binary logarithm of a number of at least 0, rounded down; that of 0 and of denormals is less than all others.
fn log2(x: f64) -> i32 {
    (x.to_bits() >> 52) as i32 - 1023
}

/// Returns a power of two.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_hardly_larger_than_wanted_unless_the_world_reaches_far() {
        for edge in [1e-30, 0.3, 1.0, 7.0, 1e30] {
            for reach in [0.0, edge, 1e6 * edge, 6e7 * edge] {
                let cell = Ticks::new(edge, reach).cell;
                assert!((edge..1.001 * edge).contains(&cell), "{cell}, not {edge}, within {reach}");
            }
            let cell = Ticks::new(edge, 1e10 * edge).cell;
            assert!((18.0..38.0).contains(&(cell / edge)), "{cell}: the end is 2^28 to 2^29 cells away");
        }
    }
}
