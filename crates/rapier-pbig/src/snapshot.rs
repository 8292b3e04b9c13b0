//! Saves and restores a broad phase, next to rapier's own sets.

use crate::PbigBroadPhase;
use pbig_adapter::Snapshot;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

impl Serialize for PbigBroadPhase {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.colliders.snapshot(self.relative_margin).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PbigBroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (colliders, relative_margin) =
            Snapshot::deserialize(deserializer)?.restore().map_err(D::Error::custom)?;
        let mut restored = Self::new();
        (restored.colliders, restored.relative_margin) = (colliders, relative_margin);
        Ok(restored)
    }
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
        assert_eq!(saved()["version"], 2);
        let error = error_with("version", json!(1));
        assert!(error.contains("version 1, but this rapier-pbig reads version 2"), "{error}");
        // The version comes first, so that a newer layout is not misread.
        let text = serde_json::to_string(&PbigBroadPhase::new()).expect("a snapshot");
        assert!(text.starts_with("{\"version\":2,"), "{text}");
    }

    #[test]
    fn a_snapshot_that_makes_no_sense_is_an_error() {
        assert!(error_with("relative_margin", json!(-0.5)).contains("margin -0.5 is not a length"));
        assert!(error_with("generations", json!("none")).contains("invalid type"));
        let mut keys: Vec<String> = saved().as_object().expect("an object").keys().cloned().collect();
        keys.sort_unstable();
        let others =
            ["adopted", "core", "generations", "is_incomplete", "relative_margin", "reversed", "sizes"];
        assert_eq!(keys, [&others[..], &["version"]].concat());
    }
}
