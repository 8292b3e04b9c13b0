//! A coordinate has one cell, whatever a compiler does to floats: `locate` computes it from integers, exactly. (That no kernel
//! computes with floats is tested in shaders/tests/valid/integers.rs.)

use super::*;

/// Returns floats of every exponent and sign, infinities too, in ascending order.
fn all_sizes() -> Vec<f32> {
    let of = |exponent: u32| {
        [0, 1, 0x2a_aaaa, 0x7f_ffff].map(|fraction| f32::from_bits(exponent << 23 | fraction))
    };
    let positive: Vec<f32> = (0..255).flat_map(of).chain([f32::INFINITY]).collect();
    positive.iter().rev().map(|x| -x).chain(positive.iter().copied()).collect()
}

/// Returns a call whose only level is not divided, so that `locate` returns cells at the finest resolution.
fn undivided(boxes: Vec<Aabb>, tick_exponent: i32, cells_per_tick: u32) -> State {
    let mut state = State::new(&Case { name: "points", boxes, small_cell: 32, columns: 8 });
    state.params = Params { tick_exponent, cells_per_tick, levels: 1, cells: 1, ..state.params };
    state.params.level[0] = Level { dims: [1; 3], ..Level::default() };
    state
}

#[test]
fn every_float_has_the_cell_of_the_twin_and_cells_never_fall() {
    let ends = all_sizes();
    let boxes = ends.windows(2).map(|two| Aabb::new([two[0]; 3], [two[1]; 3]));
    let boxes: Vec<Aabb> = boxes.chain([Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3])]).collect();
    for (tick_exponent, cells_per_tick) in [(1, 1 << 16), (47, 4096), (127, 8191), (150, 1), (248, 1 << 16)] {
        let before = undivided(boxes.clone(), tick_exponent, cells_per_tick);
        assert_eq!(fault(twin("locate"), &GpuOptions::DEFAULT, &before), None, "{tick_exponent}");
        let cells = ends.iter().map(|x| finest_cell(&before.params, ordered(*x)));
        let cells: Vec<i32> = cells.collect();
        assert!(cells.is_sorted() && cells[0] == 0, "{tick_exponent}");
        let last = (i64::from(i32::MAX) * i64::from(cells_per_tick)) >> 16;
        assert_eq!(cells.last(), Some(&(last as i32)), "{tick_exponent}");
    }
}
