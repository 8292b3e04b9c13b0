//! Saving and restoring, beside rapier's own sets.

use crate::PbigBroadPhase;
use crate::roll::Roll;
use pbig_core::{BroadPhase as Finder, Limits};
use rapier3d::prelude::{ColliderHandle, ColliderPair};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

type RawHandle = (u32, u32);

#[derive(Serialize, Deserialize)]
struct Snapshot<'a> {
    finder: Cow<'a, Finder>,
    generations: Cow<'a, [u32]>,
    relative_margin: f32,
    adopted: Vec<[RawHandle; 2]>,
}

impl Serialize for PbigBroadPhase {
    /// All that events depend on. Not the tree for queries, the device, nor a shadow.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Snapshot {
            finder: Cow::Borrowed(&self.finder),
            generations: Cow::Borrowed(self.roll.generations()),
            relative_margin: self.relative_margin,
            adopted: self.outbox.adopted.iter().map(to_raw).collect(),
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PbigBroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Snapshot { finder, generations, relative_margin, adopted } = Snapshot::deserialize(deserializer)?;
        let (finder, roll) = (finder.into_owned(), Roll::of_generations(generations.into_owned()));
        let ids = (0..finder.id_count()).filter(|&id| finder.contains(id));
        if let Some(id) = ids.into_iter().find(|&id| roll.handle(id).is_none()) {
            return Err(D::Error::custom(format!("snapshot: box {id} belongs to no collider")));
        }
        if !(relative_margin >= 0.0 && relative_margin.is_finite()) {
            return Err(D::Error::custom(format!("snapshot: margin {relative_margin} is not a length")));
        }
        if finder.config().limits != Limits::UNLIMITED {
            return Err(D::Error::custom("snapshot: a broad phase for rapier has no limits"));
        }
        let mut restored = Self::around(finder, relative_margin);
        restored.roll = roll;
        restored.outbox.adopted = adopted.into_iter().map(from_raw).collect();
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
