//! A step of the broad phase: pbig finds the pairs, and avian's own questions decide about their contacts, in avian's order.

use crate::boxes::{ColliderBoxes, Keys, Slot, ends};
use avian::collider_tree::{ColliderTreeProxy, ColliderTreeProxyFlags, ColliderTrees, MovedProxies};
use avian::collision::CollisionDiagnostics;
use avian::collision::contact_types::ContactEdgeFlags;
use avian::dynamics::joints::joint_graph::JointGraph;
use avian::prelude::*;
use bevy::ecs::system::{StaticSystemParam, SystemParam, SystemParamItem};
use bevy::platform::time::Instant;
use bevy::prelude::*;
use std::any::TypeId;
use std::ops::Deref;

/// The boxes, and the parts of a world that decide about a contact.
#[derive(SystemParam)]
pub(crate) struct Step<'w, 's, H: CollisionHooks + 'static> {
    pub(crate) boxes: ResMut<'w, ColliderBoxes>,
    pub(crate) trees: Res<'w, ColliderTrees>,
    keys: Keys<'w, 's>,
    moved: Res<'w, MovedProxies>,
    joints: Res<'w, JointGraph>,
    hooks: StaticSystemParam<'w, 's, H>,
    commands: Commands<'w, 's>,
}

impl<'w, H: CollisionHooks + 'static> Step<'w, '_, H>
where
    for<'a, 'b> SystemParamItem<'a, 'b, H>: CollisionHooks,
{
    /// Brings the boxes up to date. Calls `add` with the proxies of the pairs that the graph lacks a contact for, in the order of
    /// their ids. A pair that is not asked for or not allowed waits until one of its colliders moves.
    pub(crate) fn find_contacts<G: Deref<Target = ContactGraph>>(
        &mut self,
        graph: &mut G,
        mut add: impl FnMut(&mut G, [&ColliderTreeProxy; 2]),
    ) {
        self.boxes.moved_at = self.moved.last_changed();
        for pair in self.boxes.update(&self.trees, &self.moved, &self.keys) {
            let slots = self.boxes.slots(pair);
            if graph.contains(slots[0].collider, slots[1].collider) {
                continue;
            }
            match self.proxies(slots).filter(|proxies| self.allows(*proxies)) {
                Some(proxies) => add(graph, proxies),
                None => self.boxes.waiting.extend(ends(&pair)),
            }
        }
    }

    /// Returns the proxies of a pair, if avian would look at the pair in this update. In its order: of two that look, the one with the
    /// lower key is the first. But a sensor that looks keeps its place in the list of moved proxies.
    fn proxies(&self, mut slots: [Slot; 2]) -> Option<[&'w ColliderTreeProxy; 2]> {
        // The proxies outlive the borrow of `self`.
        let trees = Res::clone(&self.trees).into_inner();
        slots.sort_unstable_by_key(|slot| (slot.key.tree_type() as u8, slot.key.id()));
        let [one, other] = slots.map(|slot| Some((slot, slot.proxy(trees)?)));
        let (one, other) = (one?, other?);
        let is_turned = other.1.is_sensor() && other.0.moved < one.0.moved;
        let (first, second) = if is_turned { (other, one) } else { (one, other) };
        [[first, second], [second, first]].into_iter().find(looks).map(|order| order.map(|(_, proxy)| proxy))
    }

    /// Returns true if the colliders have different owners, and no joint and no hook forbids the contact.
    fn allows(&mut self, [one, other]: [&ColliderTreeProxy; 2]) -> bool {
        if one.body == other.body {
            return false;
        }
        if let (Some(one), Some(other)) = (one.body, other.body)
            && self.joints.joints_between(one, other).any(|joint| joint.collision_disabled)
        {
            return false;
        }
        if !one.flags.union(other.flags).contains(ColliderTreeProxyFlags::CUSTOM_FILTER) {
            return true;
        }
        if TypeId::of::<H>() == TypeId::of::<()>() {
            warn_once!(
                "colliders have `ActiveCollisionHooks::FILTER_PAIRS`, but pbig has no hooks, and filters none: \
                 name them in `PbigBroadPhasePlugin::<MyHooks>::default()`, and where you disable avian's own"
            );
        }
        self.hooks.filter_pairs(one.collider, other.collider, &mut self.commands)
    }
}

/// Returns true if the first proxy has moved, and avian searches the tree of the second one for it.
fn looks([(slot, proxy), (other, _)]: &[(Slot, &ColliderTreeProxy); 2]) -> bool {
    slot.moved.is_some() && (!slot.key.is_static() || proxy.is_sensor() || !other.key.is_static())
}

/// Adds contacts for the pairs that pbig finds.
pub(crate) fn add_contacts<H: CollisionHooks + 'static>(
    mut step: Step<H>,
    mut graph: ResMut<ContactGraph>,
    mut diagnostics: ResMut<CollisionDiagnostics>,
) where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    let start = Instant::now();
    step.find_contacts(&mut graph, |graph, proxies| add_contact(graph, proxies));
    diagnostics.broad_phase += start.elapsed();
}

/// Adds a contact with the flags that avian's own broad phase gives it.
fn add_contact(graph: &mut ContactGraph, [one, other]: [&ColliderTreeProxy; 2]) {
    let flags = one.flags.union(other.flags);
    let has = |flag: ColliderTreeProxyFlags| flags.contains(flag);
    let mut edge = ContactEdge::new(one.collider, other.collider);
    (edge.body1, edge.body2) = (one.body, other.body);
    edge.flags.set(ContactEdgeFlags::CONTACT_EVENTS, has(ColliderTreeProxyFlags::CONTACT_EVENTS));
    let is_solid = !has(ColliderTreeProxyFlags::BODY_DISABLED) && !has(ColliderTreeProxyFlags::SENSOR);
    graph.add_edge_with(edge, |contact| {
        (contact.body1, contact.body2) = (one.body, other.body);
        contact.flags.set(ContactPairFlags::MODIFY_CONTACTS, has(ColliderTreeProxyFlags::MODIFY_CONTACTS));
        contact.flags.set(ContactPairFlags::GENERATE_CONSTRAINTS, is_solid);
    });
}
