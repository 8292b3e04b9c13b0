//! The broad phase under test, perhaps with a planted fault.

use crate::checked::{on_its_device, pbig};
use crate::queries::compare_with_tree;
use pbig_harness::world::World;
use pbig_tests::Way;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::collections::HashMap;

/// The planted fault of the broad phase under test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Plant {
    Nothing,
    /// The third `AddPair` of a call and those after it are lost, as in too small a buffer.
    RoomForTwo,
    /// A collider is looked at again only if its box has changed, not its parent, groups or body type.
    OnlyMoved,
    /// Nothing is left after a restore.
    Forgets,
    /// Scene queries see the boxes of the step before.
    Late,
}

/// Ours, perhaps with a planted fault.
pub(super) struct Subject {
    pub(super) pbig: PbigBroadPhase,
    plant: Plant,
    /// For [`Plant::OnlyMoved`]: each collider's box when it was last listed.
    boxes: HashMap<ColliderHandle, Option<Aabb>>,
    /// For [`Plant::Late`]: the broad phase after the step before.
    before: PbigBroadPhase,
    /// In the middle of an update, where a panic is ours and not rapier's.
    pub(super) busy: bool,
}

impl Subject {
    pub(super) fn new(way: Way, plant: Plant) -> Self {
        Self { pbig: pbig(way), plant, boxes: HashMap::new(), before: pbig(way), busy: false }
    }

    /// Asks a few scene queries right after a step, when each box holds its collider. Returns the number of rays that hit.
    pub(super) fn ask(&mut self, world: &World, seed: u64) -> Result<u64, String> {
        match self.plant {
            Plant::Nothing => compare_with_tree(world, &self.pbig, &self.pbig, seed),
            Plant::Late => {
                let before = std::mem::replace(&mut self.before, self.pbig.clone());
                compare_with_tree(world, &before, &self.pbig, seed)
            }
            // Boxes may not hold their colliders.
            _ => Ok(0),
        }
    }

    /// Goes on with what was saved.
    pub(super) fn restore(&mut self, way: Way) {
        let bytes = postcard::to_stdvec(&self.pbig).expect("a broad phase can be saved");
        self.pbig = match self.plant {
            Plant::Forgets => pbig(way),
            _ => on_its_device(
                way,
                postcard::from_bytes(&bytes).expect("these are the bytes of a broad phase"),
            ),
        };
    }

    /// The modified colliders that it is shown.
    fn shown(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
    ) -> Vec<ColliderHandle> {
        if self.plant != Plant::OnlyMoved {
            return modified.to_vec();
        }
        removed.iter().for_each(|handle| _ = self.boxes.remove(handle));
        let reach = params.prediction_distance() / 2.0;
        let aabb = |handle| colliders.get(handle).map(|collider| collider.compute_collision_aabb(reach));
        let has_moved = |&handle: &ColliderHandle| {
            let now = aabb(handle);
            self.boxes.insert(handle, now) != Some(now)
        };
        modified.iter().copied().filter(has_moved).collect()
    }
}

impl BroadPhase for Subject {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        self.busy = true;
        let (shown, mut right) = (self.shown(params, colliders, modified, removed), Vec::new());
        self.pbig.update(params, colliders, bodies, &shown, removed, &mut right);
        let mut room = if self.plant == Plant::RoomForTwo { 2 } else { usize::MAX };
        right.retain(|event| {
            let added = matches!(event, BroadPhasePairEvent::AddPair(_));
            let fits = !added || room > 0;
            room -= usize::from(added && fits);
            fits
        });
        events.append(&mut right);
        self.busy = false;
    }
}
