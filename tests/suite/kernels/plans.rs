//! The contract of a plan: what the kernels rely on, for all boxes; and cells that suit them.

use super::*;

fn plan(boxes: &[Aabb]) -> Params {
    let plan = plan_params(boxes, &GpuOptions::DEFAULT, 1 << 24);
    validate(&plan);
    plan
}

fn levels(plan: &Params) -> &[Level] {
    &plan.level[..plan.levels as usize]
}

/// Asserts what the kernels rely on: of all plans that they run with here.
pub(super) fn validate(plan: &Params) {
    let mut first = 0;
    for level in levels(plan) {
        assert_eq!(level.first_cell, first, "{plan:?}");
        assert!(level.dims.iter().all(|&d| d == 1 || d >= layout::FEWEST_CELLS), "{plan:?}");
        first += level.dims.iter().product::<u32>();
    }
    assert_eq!(plan.cells, first);
    let (last, finer) = levels(plan).split_last().expect("at least one level");
    assert_eq!(last.dims, [1; 3]);
    assert!(finer.windows(2).all(|two| two[0].shift < two[1].shift), "{plan:?}");
    for k in 0..3 {
        // Undivided once, undivided in every coarser level: a box never spans more cells there.
        assert!(levels(plan).windows(2).all(|two| two[0].dims[k] > 1 || two[1].dims[k] == 1), "{plan:?}");
    }
}

fn lattice(n: u32, step: f32, half: f32) -> Vec<Aabb> {
    let at = |i: u32, d: u32| (i / d % n) as f32 * step;
    (0..n * n * n).map(|i| Aabb::from_center([at(i, 1), at(i, n), at(i, n * n)], [half; 3])).collect()
}

#[test]
fn each_size_of_many_boxes_has_a_level_beside_the_cell_for_everything() {
    let one_size = lattice(20, 1.0, 0.4);
    let Params { tick_exponent, cells_per_tick, .. } = plan(&one_size);
    let cells = 2f64.powi(tick_exponent - 150 + 16) / f64::from(cells_per_tick);
    assert!((0.4..4.0).contains(&cells), "{cells}");
    let huge = [one_size.clone(), vec![Aabb::new([-1e4; 3], [1e4; 3])]].concat();
    let two_sizes = [lattice(40, 1.0, 0.0005), lattice(10, 16.0, 8.0)].concat();
    let oversize = vec![Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]); 3];
    for (boxes, levels) in [(one_size, 2), (huge, 2), (two_sizes, 3), (oversize, 1), (vec![], 1)] {
        assert_eq!(plan(&boxes).levels, levels, "{} boxes", boxes.len());
    }
}

/// A cover barely wider than the scene is in the sample, because the first box always is.
#[test]
fn a_cover_around_the_scene_does_not_add_cells() {
    let with = |half: f32| {
        let cover = Aabb::from_center([52.0; 3], [half; 3]);
        plan(&[vec![cover], lattice(80, 1.3, 0.5)].concat()).cells
    };
    let [small, cover] = [0.5, 53.0].map(with);
    assert!(cover.abs_diff(small) < small / 10, "{cover} cells, {small} without a cover");
}
