//! Saves and restores a broad phase, next to rapier's own sets.

use crate::PbigBroadPhase;
use crate::registry::ColliderRegistry;
use rapier3d::prelude::{ColliderHandle, ColliderPair};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

/// The version of [`Snapshot`]'s layout. Increased whenever the layout changes.
const VERSION: u32 = 1;

type RawHandle = (u32, u32);

/// Everything that later events depend on. The tree for queries, the device and a shadow are not part of it.
#[derive(Serialize, Deserialize)]
struct Snapshot<'a> {
    /// The first field, so that another version is named before its layout is misread.
    #[serde(deserialize_with = "this_version")]
    version: u32,
    core: Cow<'a, pbig_core::BroadPhase>,
    generations: Cow<'a, [u32]>,
    relative_margin: f32,
    adopted: Vec<[RawHandle; 2]>,
}

/// Reads the version, and fails if it is another one.
fn this_version<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    match u32::deserialize(deserializer)? {
        VERSION => Ok(VERSION),
        other => Err(D::Error::custom(format!(
            "the snapshot of the broad phase has version {other}, but this rapier-pbig reads version {VERSION}: \
             save the world again, or adopt it with a new broad phase"
        ))),
    }
}

impl Serialize for PbigBroadPhase {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Snapshot {
            version: VERSION,
            core: Cow::Borrowed(&self.core),
            generations: Cow::Borrowed(self.registry.generations()),
            relative_margin: self.relative_margin,
            adopted: self.writer.adopted.iter().map(to_raw).collect(),
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PbigBroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Snapshot::deserialize(deserializer)?.restore().map_err(D::Error::custom)
    }
}

impl Snapshot<'_> {
    fn restore(self) -> Result<PbigBroadPhase, String> {
        let core = self.core.into_owned();
        let registry = ColliderRegistry::from_generations(self.generations.into_owned());
        let mut ids = (0..core.id_count()).filter(|&id| core.contains(id));
        if let Some(id) = ids.find(|&id| registry.handle(id).is_none()) {
            return Err(format!("snapshot: box {id} belongs to no collider"));
        }
        let relative_margin = self.relative_margin;
        if !(relative_margin >= 0.0 && relative_margin.is_finite()) {
            return Err(format!("snapshot: margin {relative_margin} is not a length"));
        }
        let mut restored = PbigBroadPhase::around(core);
        (restored.registry, restored.relative_margin) = (registry, relative_margin);
        restored.writer.adopted = self.adopted.into_iter().map(from_raw).collect();
        Ok(restored)
    }
}

fn to_raw(pair: &ColliderPair) -> [RawHandle; 2] {
    [pair.collider1.into_raw_parts(), pair.collider2.into_raw_parts()]
}

fn from_raw(pair: [RawHandle; 2]) -> ColliderPair {
    let [a, b] = pair.map(|(index, generation)| ColliderHandle::from_raw_parts(index, generation));
    ColliderPair::new(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn saved() -> Value {
        serde_json::to_value(PbigBroadPhase::new()).expect("a snapshot")
    }

    fn error_with(field: &str, value: Value) -> String {
        let mut changed = saved();
        changed[field] = value;
        serde_json::from_value::<PbigBroadPhase>(changed).expect_err("an error").to_string()
    }

    #[test]
    fn a_snapshot_of_another_version_is_an_error_that_names_both() {
        assert_eq!(saved()["version"], VERSION);
        let error = error_with("version", json!(VERSION + 1));
        assert!(error.contains("version 2, but this rapier-pbig reads version 1"), "{error}");
        // The version comes first, so that a newer layout is not misread.
        let text = serde_json::to_string(&PbigBroadPhase::new()).expect("a snapshot");
        assert!(text.starts_with("{\"version\":1,"), "{text}");
    }

    #[test]
    fn a_snapshot_that_makes_no_sense_is_an_error() {
        assert!(error_with("relative_margin", json!(-0.5)).contains("margin -0.5 is not a length"));
        assert!(error_with("generations", json!("none")).contains("invalid type"));
        let mut keys: Vec<String> = saved().as_object().expect("an object").keys().cloned().collect();
        keys.sort_unstable();
        assert_eq!(keys, ["adopted", "core", "generations", "relative_margin", "version"]);
    }
}
