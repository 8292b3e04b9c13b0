//! pbig beside avian's own broad phase, which stays in charge: each step, the pairs of both are compared.

use crate::step::Step;
use avian::collider_tree::{ColliderTreeProxyKey, ColliderTrees};
use avian::prelude::*;
use bevy::ecs::system::SystemParamItem;
use bevy::prelude::*;
use std::collections::{BTreeSet, HashSet};

/// The result of the comparisons that [`crate::PbigBroadPhasePlugin::as_shadow`] makes.
#[derive(Resource, Debug, Default)]
pub struct Shadow {
    /// Contacts compared in all steps.
    pub compared: u64,
    /// Pairs that only avian's own broad phase has.
    pub missing: BTreeSet<(Entity, Entity)>,
    /// Pairs that only pbig has.
    pub spurious: BTreeSet<(Entity, Entity)>,
}

/// Compares the pairs that pbig finds with the contacts that avian has.
pub(crate) fn compare<H: CollisionHooks + 'static>(
    mut step: Step<H>,
    mut graph: Res<ContactGraph>,
    keys: Query<&ColliderTreeProxyKey>,
    mut shadow: ResMut<Shadow>,
) where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    let ordered = |a: Entity, b: Entity| (a.min(b), a.max(b));
    step.find_contacts(&mut graph, |_, [one, other]| {
        shadow.spurious.insert(ordered(one.collider, other.collider));
    });
    let ours: HashSet<_> = step.boxes.pairs().map(|(a, b)| ordered(a, b)).collect();
    for contact in graph.active_pairs().iter().chain(graph.sleeping_pairs()) {
        let (a, b) = ordered(contact.collider1, contact.collider2);
        shadow.compared += 1;
        if !ours.contains(&(a, b)) && is_found(&step.trees, &keys, a, b) {
            shadow.missing.insert((a, b));
        }
    }
}

/// Returns true if avian would find the pair now, if both had moved. Contacts live on for a short distance; those of sleeping
/// bodies also when layers no longer allow them. It reads avian's trees alone, so that it finds mistakes of
/// the boxes.
fn is_found(trees: &ColliderTrees, keys: &Query<&ColliderTreeProxyKey>, a: Entity, b: Entity) -> bool {
    let find = |collider| {
        let &key = keys.get(collider).ok()?;
        let tree = trees.tree_for_type(key.tree_type());
        Some((key, tree.get_proxy_aabb(key.id())?, tree.get_proxy(key.id())?))
    };
    find(a).zip(find(b)).is_some_and(|((key, aabb, one), (other_key, other_aabb, other))| {
        let is_apart = (aabb.min.cmpgt(other_aabb.max) | other_aabb.min.cmpgt(aabb.max)).any();
        let are_static = key.is_static() && other_key.is_static() && !one.is_sensor() && !other.is_sensor();
        !is_apart && !are_static && one.body != other.body && one.layers.interacts_with(other.layers)
    })
}
