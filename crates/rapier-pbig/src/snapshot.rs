//! Saving and restoring, beside rapier's own sets.

use crate::PbigBroadPhase;
use crate::events::HandleOrder;
use crate::overlap::Overlap;
use crate::roll::Roll;
use pbig_core::{BroadPhase as Finder, Events, Limits, Pair};
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
    ulps: u32,
    order: HandleOrder,
    adopted: Vec<[RawHandle; 2]>,
    overlap: Option<Ahead>,
}

/// Of [`Overlap`] what later calls depend on.
#[derive(Serialize, Deserialize)]
struct Ahead {
    added: Vec<Pair>,
    removed: Vec<Pair>,
    gone: Vec<u32>,
    quiet: bool,
}

impl Ahead {
    fn new(overlap: &Overlap) -> Self {
        let Events { added, removed } = overlap.unsent.clone();
        let mut gone: Vec<u32> = overlap.gone.iter().copied().collect();
        gone.sort_unstable();
        Self { added, removed, gone, quiet: overlap.quiet }
    }

    /// Events are sent as the finder's pairs say, and counted by them.
    fn restore(self, finder: &Finder) -> Result<Overlap, String> {
        let is_gone = |pair: &Pair| self.gone.contains(&pair.a) || self.gone.contains(&pair.b);
        for (pairs, kept) in [(&self.added, true), (&self.removed, false)] {
            let known = |pair: &Pair| pair.a < pair.b && pair.b < finder.id_count();
            let good = |pair: &Pair| known(pair) && (is_gone(pair) || finder.has_pair(*pair) == kept);
            if !pairs.iter().all(good) || !pairs.is_sorted_by(|one, next| one < next) {
                return Err("snapshot: events of unknown boxes or pairs, or out of order".into());
            }
        }
        let unsent = Events { added: self.added, removed: self.removed };
        let gone = self.gone.into_iter().collect();
        Ok(Overlap { unsent, gone, quiet: self.quiet, ..Overlap::default() })
    }
}

impl Serialize for PbigBroadPhase {
    /// All that events depend on. Not the tree for queries, the device, nor a shadow.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Snapshot {
            finder: Cow::Borrowed(&self.finder),
            generations: Cow::Borrowed(self.roll.generations()),
            relative_margin: self.relative_margin,
            ulps: self.ulps,
            order: self.outbox.order,
            adopted: self.outbox.adopted.iter().map(to_raw).collect(),
            overlap: self.overlap.as_deref().map(Ahead::new),
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PbigBroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Snapshot { finder, generations, relative_margin, ulps, order, adopted, overlap } =
            Snapshot::deserialize(deserializer)?;
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
        if finder.has_begun() && overlap.is_none() {
            return Err(D::Error::custom("snapshot: a search that has begun, and nobody who waits for it"));
        }
        let overlap = overlap.map(|ahead| ahead.restore(&finder)).transpose();
        let mut restored = Self::around(finder, relative_margin).with_handle_order(order);
        restored.roll = roll;
        restored.ulps = ulps;
        restored.overlap = overlap.map_err(D::Error::custom)?.map(Box::new);
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
