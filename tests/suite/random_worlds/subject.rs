//! The broad phase under test, perhaps with a planted fault.

use crate::checked::{on_its_device, pbig};
use pbig_tests::Way;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

pub(super) struct Subject {
    pub(super) pbig: PbigBroadPhase,
    /// A planted fault: the third `AddPair` of a call and those after it are lost, as in too small a buffer.
    has_room_for_two: bool,
    /// In the middle of an update, where a panic is ours and not rapier's.
    pub(super) busy: bool,
}

impl Subject {
    pub(super) fn new(way: Way, has_room_for_two: bool) -> Self {
        Self { pbig: pbig(way), has_room_for_two, busy: false }
    }

    /// Goes on with what was saved.
    pub(super) fn restore(&mut self, way: Way) {
        let bytes = postcard::to_stdvec(&self.pbig).expect("a broad phase can be saved");
        let saved = postcard::from_bytes(&bytes).expect("these are the bytes of a broad phase");
        self.pbig = on_its_device(way, saved);
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
        let mut right = Vec::new();
        self.pbig.update(params, colliders, bodies, modified, removed, &mut right);
        let mut room = if self.has_room_for_two { 2 } else { usize::MAX };
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
