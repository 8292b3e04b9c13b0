//! The system that adds contacts for the pairs that pbig finds.

use crate::ask::Ask;
use crate::boxes::ColliderBoxes;
use crate::lost::Lost;
use avian::collider_tree::{
    ColliderTreeProxy, ColliderTreeProxyFlags, ColliderTreeProxyKey, ColliderTrees, MovedProxies,
};
use avian::collision::CollisionDiagnostics;
use avian::collision::contact_types::ContactEdgeFlags;
use avian::dynamics::joints::joint_graph::JointGraph;
use avian::prelude::*;
use bevy::ecs::system::{StaticSystemParam, SystemParam, SystemParamItem};
use bevy::platform::time::Instant;
use bevy::prelude::*;
use pbig_core::{Error, Pair};

/// The parts of a world that a step of the broad phase reads.
#[derive(SystemParam)]
pub(crate) struct StepInput<'w, 's> {
    pub(crate) trees: Res<'w, ColliderTrees>,
    pub(crate) moved: Res<'w, MovedProxies>,
    pub(crate) joints: Res<'w, JointGraph>,
    /// The proxies of colliders that take part in collisions.
    pub(crate) keys: Query<'w, 's, &'static ColliderTreeProxyKey, Without<ColliderDisabled>>,
    pub(crate) lost: ResMut<'w, Lost>,
}

impl StepInput<'_, '_> {
    /// Brings the boxes up to date, and lists the pairs to ask about, in the order of their ids: those that have begun, and those
    /// without a contact.
    pub(crate) fn candidates(&mut self, boxes: &mut ColliderBoxes) -> (Vec<Pair>, Result<(), String>) {
        let followed = boxes.follow(self);
        let (pairs, found) = boxes.find();
        (pairs, followed.and(found).map_err(|error| in_words(&error)))
    }
}

/// Returns an error in words. The core's own words ask for larger limits, which the plug-in has no setting for.
fn in_words(error: &Error) -> String {
    match error {
        Error::TooManyBoxes { limit, .. } => format!("the plug-in takes at most {limit} colliders"),
        Error::TooManyPairs { limit } => format!("the plug-in keeps at most {limit} overlapping pairs"),
        other => other.to_string(),
    }
}

pub(crate) fn add_contacts<H: CollisionHooks + 'static>(
    mut boxes: ResMut<ColliderBoxes>,
    mut input: StepInput,
    hooks: StaticSystemParam<H>,
    mut commands: Commands,
    mut graph: ResMut<ContactGraph>,
    mut diagnostics: ResMut<CollisionDiagnostics>,
) where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    let start = Instant::now();
    let (pairs, done) = input.candidates(&mut boxes);
    let ask = Ask { trees: &input.trees, joints: &input.joints, hooks: &hooks.into_inner() };
    pairs.into_iter().for_each(|pair| add_contact(&ask, &mut boxes, pair, &mut graph, &mut commands));
    if let Err(error) = done {
        error!("pbig: {error}; some pairs that began in this step have no contact yet");
    }
    diagnostics.broad_phase += start.elapsed();
}

/// Adds a contact for a pair that is asked for and allowed; otherwise the pair waits until one of its colliders moves.
fn add_contact<H: CollisionHooks>(
    ask: &Ask<'_, H>,
    boxes: &mut ColliderBoxes,
    pair: Pair,
    graph: &mut ContactGraph,
    commands: &mut Commands,
) {
    let (a, b) = boxes.colliders(pair);
    let has_contact = graph.contains(a, b)
        || ask.proxies(boxes, pair).is_some_and(|proxies| {
            let is_allowed = ask.allows(proxies, commands);
            if is_allowed {
                add_edge(graph, proxies);
            }
            is_allowed
        });
    boxes.without_contact.set(pair, !has_contact);
}

/// Adds a contact with the flags that avian's own broad phase gives it.
fn add_edge(graph: &mut ContactGraph, [one, other]: [&ColliderTreeProxy; 2]) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_no_setting_that_a_user_lacks() {
        let limits = [Error::TooManyBoxes { boxes: 9, limit: 8 }, Error::TooManyPairs { limit: 8 }];
        for text in limits.map(|error| in_words(&error)) {
            assert!(text.contains("at most 8 ") && !text.contains("max_"), "{text}");
        }
        assert!(in_words(&Error::SparseId { id: 9, known: 1 }).contains("id 9"));
    }
}
