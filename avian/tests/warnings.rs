//! Warnings of plug-ins that have no use together, or no use alone.

mod support;

use avian::prelude::*;
use avian_pbig::PbigBroadPhasePlugin;
use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};
use support::{Veto, app, plugins};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

/// Keeps the texts of warnings.
#[derive(Clone, Default)]
struct Warnings(Arc<Mutex<Vec<String>>>);

impl Visit for Warnings {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0.lock().expect("texts").push(format!("{value:?}"));
        }
    }
}

impl Subscriber for Warnings {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() == Level::WARN && metadata.target().starts_with("avian_pbig")
    }
    fn event(&self, event: &Event<'_>) {
        event.record(&mut self.clone());
    }
    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }
    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

/// Returns the warnings of an app that is built and steps three times.
fn warnings(plugins: PluginGroupBuilder) -> Vec<String> {
    let warnings = Warnings::default();
    tracing::subscriber::with_default(warnings.clone(), || {
        let mut app = app(plugins);
        let hooks = ActiveCollisionHooks::FILTER_PAIRS;
        for _ in 0..2 {
            app.world_mut().spawn((RigidBody::Dynamic, support::collider(1.0), Transform::default(), hooks));
        }
        (0..3).for_each(|_| app.update());
    });
    std::mem::take(&mut warnings.0.lock().expect("texts"))
}

fn pbig() -> PbigBroadPhasePlugin<Veto<'static, 'static>> {
    PbigBroadPhasePlugin::default()
}

#[test]
fn a_shadow_of_no_broad_phase_warns_once() {
    let without = plugins().disable::<BvhBroadPhasePlugin<Veto>>();
    let texts = warnings(without.add(pbig().as_shadow()));
    assert!(matches!(&texts[..], [text] if text.contains("as_shadow")), "{texts:?}");
}

#[test]
fn two_broad_phases_in_charge_warn_once() {
    let texts = warnings(plugins().add(pbig()));
    assert!(matches!(&texts[..], [text] if text.contains("disable")), "{texts:?}");
}

#[test]
fn colliders_that_ask_for_hooks_warn_once_if_pbig_has_none() {
    let without = plugins().disable::<BvhBroadPhasePlugin<Veto>>();
    let texts = warnings(without.add(PbigBroadPhasePlugin::new()));
    assert!(matches!(&texts[..], [text] if text.contains("FILTER_PAIRS")), "{texts:?}");
}

#[test]
fn a_shadow_and_a_replacement_warn_of_nothing() {
    let without = plugins().disable::<BvhBroadPhasePlugin<Veto>>();
    for plugins in [plugins().add(pbig().as_shadow()), without.add(pbig())] {
        assert_eq!(warnings(plugins), Vec::<String>::new());
    }
}
