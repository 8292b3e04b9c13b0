use super::*;
use pbig_core::find_pairs;

fn scenes(n: usize) -> impl Iterator<Item = MovingBoxes> {
    Motion::ALL
        .into_iter()
        .flat_map(move |motion| Density::ALL.map(|density| MovingBoxes::new(motion, density, n, 1)))
}

#[test]
fn pairs_a_box_are_as_many_as_the_density_says_in_every_frame() {
    for motion in Motion::ALL {
        for density in Density::ALL {
            let mut scene = MovingBoxes::new(motion, density, 4000, 1);
            for frame in 0..60 {
                if frame % 15 == 0 {
                    let present = scene.boxes().iter().filter(|b| b.is_valid()).count() as f64;
                    let pairs = find_pairs(scene.boxes()).expect("few pairs").len() as f64 / present;
                    let off = pairs / density.pairs_per_box() - 1.0;
                    assert!(off.abs() < 0.15, "{motion:?}, {density:?}, frame {frame}: {pairs}");
                }
                scene.step();
            }
        }
    }
}

#[test]
fn shares_of_changed_boxes_are_as_told() {
    let counts = |motion, frames: usize| -> Vec<usize> {
        let mut scene = MovingBoxes::new(motion, Density::Sparse, 1000, 1);
        (0..frames).map(|_| scene.step().len()).collect()
    };
    for motion in [Motion::Drift, Motion::Jitter, Motion::Swing, Motion::Fall] {
        assert_eq!(counts(motion, 3), [1000; 3], "{motion:?}");
    }
    assert_eq!(counts(Motion::Jump, 25), [50; 25]);
    assert_eq!(counts(Motion::Few, 3), [10; 3]);
    assert_eq!(counts(Motion::Shares, 6), [0, 20, 500, 0, 20, 500]);
    assert_eq!(counts(Motion::Burst, 40), [[0; 10], [1000; 10], [0; 10], [1000; 10]].concat());
    assert_eq!(counts(Motion::Churn, 3), [20; 3], "ten leave and ten come");
}

#[test]
fn exactly_the_named_boxes_change_and_all_stay_in_the_space() {
    for mut scene in scenes(300) {
        for _ in 0..25 {
            let before = scene.boxes().to_vec();
            let changed = scene.step().to_vec();
            assert!(changed.is_sorted_by(|a, b| a < b));
            let now = scene.boxes();
            let same = |id: usize| before[id] == now[id] || !(before[id].is_valid() || now[id].is_valid());
            let differ: Vec<u32> = (0..300).filter(|&id| !same(id as usize)).collect();
            assert_eq!(changed, differ, "{:?}", scene.motion);
            let (low, high) = (-scene.side, 2.0 * scene.side);
            let present: Vec<_> = now.iter().filter(|b| b.is_valid()).collect();
            assert!(present.iter().all(|b| b.min[1] > low - 5.0 && b.max[1] < high));
            assert_eq!(present.len(), 300 - if scene.motion == Motion::Churn { 30 } else { 0 });
        }
    }
}
