//! Records of steps: contacts and collision events, by the numbers of their colliders. Two worlds that change alike have equal ones.

use super::{Number, app, app_with_pbig, plugins};
use avian::prelude::*;
use bevy::prelude::*;
use std::collections::{BTreeSet, HashMap};

/// The numbers of all entities that have or had one.
#[derive(Resource, Default)]
struct Numbers(HashMap<Entity, Number>);

/// A contact: its colliders, their bodies, the bits of its flags, and whether it sleeps.
type Contact = ([Option<Number>; 2], [Option<Number>; 2], u16, bool);

/// The contacts that a step leaves, and its collision events: true if they started.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub(crate) struct Record {
    pub(crate) contacts: BTreeSet<Contact>,
    pub(crate) events: BTreeSet<(bool, [Option<Number>; 2])>,
}

/// The number of contacts and of collision events that were compared.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Compared {
    pub(crate) steps: usize,
    pub(crate) contacts: usize,
    pub(crate) events: usize,
}

/// Makes two apps that keep records: one with pbig in place of avian's broad phase, one with avian's own.
pub(crate) fn both() -> [App; 2] {
    [app_with_pbig(), app(plugins())].map(|mut app| {
        app.init_resource::<Numbers>().init_resource::<Record>();
        app.add_observer(|on: On<Insert<Number>>, numbers: Query<&Number>, mut all: ResMut<Numbers>| {
            all.0.insert(on.entity, *numbers.get(on.entity).expect("a number"));
        });
        app.add_systems(Last, (record_contacts, record_events));
        app
    })
}

impl Compared {
    /// Steps both apps. Returns what only one of them has: first pbig's, then avian's own.
    pub(crate) fn step(&mut self, apps: &mut [App; 2]) -> [Record; 2] {
        apps.iter_mut().for_each(App::update);
        let [ours, avians] = apps.each_ref().map(|app| app.world().resource::<Record>());
        self.steps += 1;
        self.contacts += avians.contacts.len();
        self.events += avians.events.len();
        [ours.without(avians), avians.without(ours)]
    }
}

impl Record {
    fn without(&self, other: &Self) -> Self {
        let contacts = self.contacts.difference(&other.contacts).copied().collect();
        Self { contacts, events: self.events.difference(&other.events).copied().collect() }
    }

    /// Returns the numbers of all colliders.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = Number> {
        let of_contacts = self.contacts.iter().map(|contact| contact.0);
        of_contacts.chain(self.events.iter().map(|event| event.1)).flatten().flatten()
    }
}

fn record_contacts(graph: Res<ContactGraph>, numbers: Res<Numbers>, mut record: ResMut<Record>) {
    let number = |entity: Entity| numbers.0.get(&entity).copied();
    let of = |pair: &ContactPair, is_asleep| {
        let bodies = [pair.body1, pair.body2].map(|body| body.and_then(number));
        ([number(pair.collider1), number(pair.collider2)], bodies, pair.flags.bits(), is_asleep)
    };
    let active = graph.active_pairs().iter().map(|pair| of(pair, false));
    record.contacts = active.chain(graph.sleeping_pairs().iter().map(|pair| of(pair, true))).collect();
}

fn record_events(
    mut started: MessageReader<CollisionStart>,
    mut ended: MessageReader<CollisionEnd>,
    numbers: Res<Numbers>,
    mut record: ResMut<Record>,
) {
    let both = |one: Entity, other: Entity| [one, other].map(|entity| numbers.0.get(&entity).copied());
    let started = started.read().map(|event| (true, both(event.collider1, event.collider2)));
    record.events = started.collect();
    record.events.extend(ended.read().map(|event| (false, both(event.collider1, event.collider2))));
}
