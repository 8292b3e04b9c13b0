//! The questions that decide about a contact for an overlapping pair: avian's own, in avian's order.

use crate::boxes::{ColliderBoxes, Slot};
use avian::collider_tree::{ColliderTreeProxy, ColliderTreeProxyFlags, ColliderTreeType, ColliderTrees};
use avian::dynamics::joints::joint_graph::JointGraph;
use avian::prelude::*;
use bevy::prelude::*;
use pbig_core::Pair;

/// The parts of a world that decide about a contact.
pub(crate) struct Ask<'a, H> {
    pub(crate) trees: &'a ColliderTrees,
    pub(crate) joints: &'a JointGraph,
    pub(crate) hooks: &'a H,
}

impl<'a, H: CollisionHooks> Ask<'a, H> {
    /// Returns the proxies of a pair, in avian's order, if avian would look at the pair in this update.
    pub(crate) fn proxies(&self, boxes: &ColliderBoxes, pair: Pair) -> Option<[&'a ColliderTreeProxy; 2]> {
        let [one, other] = [pair.a, pair.b].map(|id| &boxes.slots[id as usize]);
        let proxy =
            |slot: &Slot| self.trees.get_proxy(slot.key).filter(|proxy| proxy.collider == slot.collider);
        let proxies = [proxy(one)?, proxy(other)?];
        let looks = [
            one.has_moved && looks_into(one, proxies[0], other),
            other.has_moved && looks_into(other, proxies[1], one),
        ];
        match looks {
            [false, false] => None,
            [true, true] if order(other) < order(one) => Some([proxies[1], proxies[0]]),
            [false, true] => Some([proxies[1], proxies[0]]),
            _ => Some(proxies),
        }
    }

    /// Returns true if no joint and no hook forbids the contact.
    pub(crate) fn allows(&self, [one, other]: [&ColliderTreeProxy; 2], commands: &mut Commands) -> bool {
        if let (Some(one), Some(other)) = (one.body, other.body)
            && self.joints.joints_between(one, other).any(|joint| joint.collision_disabled)
        {
            return false;
        }
        !one.flags.union(other.flags).contains(ColliderTreeProxyFlags::CUSTOM_FILTER)
            || self.hooks.filter_pairs(one.collider, other.collider, commands)
    }
}

/// Returns true if avian searches the tree of `other` for a moved proxy.
fn looks_into(slot: &Slot, proxy: &ColliderTreeProxy, other: &Slot) -> bool {
    let is_static = |slot: &Slot| slot.key.tree_type() == ColliderTreeType::Static;
    !is_static(slot) || proxy.is_sensor() || !is_static(other)
}

/// Returns the order of two moved proxies in avian: the lower one is the first of the pair.
fn order(slot: &Slot) -> (u8, u32) {
    (slot.key.tree_type() as u8, slot.key.id().id())
}
