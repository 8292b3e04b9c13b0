//! Boxes that come find room in the tree.

use super::{check_form, scattered};
use crate::Aabb;
use crate::bvh::{BoxIndex, LANES, NONE};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Wherever boxes come, the lanes of those that went are enough for them.
#[test]
fn boxes_that_come_find_the_room_of_those_that_went() {
    let (n, mut rng) = (20_000, StdRng::seed_from_u64(2));
    let (mut boxes, elsewhere, mut index) = (scattered(n), scattered(n), BoxIndex::default());
    let present = 0..n as u32;
    index.refresh_present(&boxes, None, present.clone(), true);
    for round in 0..40 {
        let changed: Vec<u32> = (0..n as u32).filter(|id| (id * 7 + round) % 40 < 2).collect();
        for id in &changed {
            let is_there = (id * 7 + round) % 40 == 1;
            boxes[*id as usize] = if is_there { elsewhere[rng.random_range(0..n)] } else { Aabb::NOWHERE };
        }
        index.refresh_present(&boxes, Some(&changed), present.clone(), true);
        check_form(&index, &boxes);
        assert!(index.loose().len() < 12, "round {round}: {} leaves outside the tree", index.loose().len());
    }
}

/// A leaf that has become empty takes the next boxes there, and so do all leaves of a node.
#[test]
fn boxes_that_go_and_come_back_find_their_empty_leaves() {
    let boxes = scattered(3000);
    for together in [1, LANES] {
        let (mut index, mut some) = (BoxIndex::default(), boxes.clone());
        index.refresh(&boxes, None);
        for first in (0..index.leaves as usize / 3).step_by(LANES) {
            let leaves = &index.nodes[first..first + together];
            let ids: Vec<u32> =
                leaves.iter().flat_map(|leaf| leaf.children).filter(|id| *id != NONE).collect();
            ids.iter().for_each(|id| some[*id as usize] = Aabb::NOWHERE);
            index.refresh(&some, Some(&ids));
            ids.iter().for_each(|id| some[*id as usize] = boxes[*id as usize]);
            index.refresh(&some, Some(&ids));
            check_form(&index, &some);
        }
        assert!(index.loose().is_empty(), "{} leaves outside the tree", index.loose().len());
    }
}

/// Many boxes came, and the tree is laid out anew: the next ones find room.
#[test]
fn a_layout_for_look_ups_leaves_room() {
    let (mut index, mut boxes) = (BoxIndex::default(), scattered(2000));
    index.refresh_present(&boxes, None, 0..2000, true);
    boxes.extend(scattered(6000));
    index.refresh_present(&boxes, None, 0..8000, true);
    let full = index.room[..index.leaves as usize].iter().filter(|room| **room == 0).count();
    assert!(full < 10, "{full} of {} leaves are full", index.leaves);
}
