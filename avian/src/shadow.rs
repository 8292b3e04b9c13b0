//! pbig beside avian's own broad phase, which stays in charge: each step, the pairs of both are compared.

use crate::ask::Ask;
use crate::boxes::ColliderBoxes;
use crate::collect::StepInput;
use avian::collider_tree::{ColliderTreeProxyKey, ColliderTreeSystems};
use avian::collision::broad_phase::BroadPhaseSystems;
use avian::prelude::*;
use bevy::ecs::system::{StaticSystemParam, SystemParamItem};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use std::collections::BTreeSet;
use std::marker::PhantomData;

/// Compares the pairs of pbig with those of avian's own broad phase. Add it beside `BvhBroadPhasePlugin`, with the same hooks, and
/// without [`crate::PbigBroadPhasePlugin`]. Hooks are asked twice.
///
/// ```
/// use avian::prelude::*; // avian2d or avian3d
/// use avian_pbig::shadow::{Shadow, ShadowPlugin};
/// use bevy::prelude::*;
///
/// let mut app = App::new();
/// app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin));
/// app.add_plugins(PhysicsPlugins::default().build().add(ShadowPlugin::new()));
/// app.finish();
/// app.cleanup();
/// app.update();
/// let shadow = app.world().resource::<Shadow>();
/// assert!(shadow.missing.is_empty() && shadow.spurious.is_empty(), "{shadow:?}");
/// ```
pub struct ShadowPlugin<H: CollisionHooks = ()>(PhantomData<H>);

impl ShadowPlugin {
    /// Makes the plugin without collision hooks.
    pub fn new() -> Self {
        Self::default()
    }
}

impl<H: CollisionHooks> Default for ShadowPlugin<H> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

/// The result of the comparisons.
#[derive(Resource, Debug, Default)]
pub struct Shadow {
    /// Contacts compared in all steps.
    pub compared: u64,
    /// Pairs that only avian's own broad phase has.
    pub missing: BTreeSet<(Entity, Entity)>,
    /// Pairs that only pbig has.
    pub spurious: BTreeSet<(Entity, Entity)>,
}

impl<H: CollisionHooks + 'static> Plugin for ShadowPlugin<H>
where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    fn build(&self, app: &mut App) {
        crate::follow_colliders(app);
        app.init_resource::<Shadow>();
        app.add_systems(
            PhysicsSchedule,
            compare::<H>
                .after(BroadPhaseSystems::CollectCollisions)
                .before(ColliderTreeSystems::BeginOptimize)
                .in_set(PhysicsStepSystems::BroadPhase),
        );
    }
}

fn compare<H: CollisionHooks + 'static>(
    mut boxes: ResMut<ColliderBoxes>,
    mut input: StepInput,
    hooks: StaticSystemParam<H>,
    mut commands: Commands,
    graph: Res<ContactGraph>,
    keys: Query<&ColliderTreeProxyKey>,
    mut shadow: ResMut<Shadow>,
) where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    let (candidates, done) = input.candidates(&mut boxes);
    if let Err(error) = done {
        error!("pbig: {error}");
    }
    let ask = Ask { trees: &input.trees, joints: &input.joints, hooks: &hooks.into_inner() };
    for pair in candidates {
        let (a, b) = boxes.colliders(pair);
        let has_contact = graph.contains(a, b);
        let is_wanted = ask.proxies(&boxes, pair).is_some_and(|proxies| ask.allows(proxies, &mut commands));
        if is_wanted && !has_contact {
            shadow.spurious.insert((a, b));
        }
        boxes.without_contact.set(pair, !has_contact);
    }
    let ours: HashSet<_> = boxes.pairs().map(|(a, b)| ordered(a, b)).collect();
    for contact in graph.active_pairs().iter().chain(graph.sleeping_pairs()) {
        let (a, b) = ordered(contact.collider1, contact.collider2);
        shadow.compared += 1;
        if !ours.contains(&(a, b)) && is_found(&input, &keys, a, b) {
            shadow.missing.insert((a, b));
        }
    }
}

fn ordered(a: Entity, b: Entity) -> (Entity, Entity) {
    (a.min(b), a.max(b))
}

/// Returns true if avian would find the pair now, if both had moved. Contacts live on for a short distance; those of sleeping bodies
/// also when layers no longer allow them.
fn is_found(input: &StepInput, keys: &Query<&ColliderTreeProxyKey>, a: Entity, b: Entity) -> bool {
    let proxy = |collider: Entity| {
        let &key = keys.get(collider).ok()?;
        let aabb = input.trees.tree_for_type(key.tree_type()).get_proxy_aabb(key.id())?;
        Some((key, aabb, input.trees.get_proxy(key)?))
    };
    let (Some((key, aabb, one)), Some((other_key, other_aabb, other))) = (proxy(a), proxy(b)) else {
        return false;
    };
    let is_apart = (aabb.min.cmpgt(other_aabb.max) | other_aabb.min.cmpgt(aabb.max)).any();
    let are_static = key.is_static() && other_key.is_static() && !one.is_sensor() && !other.is_sensor();
    !is_apart && !are_static && one.body != other.body && one.layers.interacts_with(other.layers)
}
