//! Saving and restoring, beside rapier's own sets.

use crate::PbigBroadPhase;
use crate::events::HandleOrder;
use crate::roll::Roll;
use pbig_core::{BroadPhase as Finder, Limits};
use rapier3d::prelude::{ColliderHandle, ColliderPair};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

type RawHandle = (u32, u32);

#[derive(Serialize)]
struct Saved<'a> {
    finder: &'a Finder,
    generations: &'a [u32],
    relative_margin: f32,
    order: HandleOrder,
    adopted: Vec<[RawHandle; 2]>,
}

#[derive(Deserialize)]
struct Restored {
    finder: Finder,
    generations: Vec<u32>,
    relative_margin: f32,
    order: HandleOrder,
    adopted: Vec<[RawHandle; 2]>,
}

impl Serialize for PbigBroadPhase {
    /// All that events depend on. Not the tree for queries, the device, nor a shadow.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Saved {
            finder: &self.finder,
            generations: self.roll.generations(),
            relative_margin: self.relative_margin,
            order: self.outbox.order,
            adopted: self.outbox.adopted.iter().map(to_raw).collect(),
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PbigBroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Restored { finder, generations, relative_margin, order, adopted } =
            Restored::deserialize(deserializer)?;
        let roll = Roll::of_generations(generations);
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
        let mut restored = Self::around(finder, relative_margin).with_handle_order(order);
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
