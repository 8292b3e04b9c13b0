//! Saves and restores a broad phase, next to rapier's own sets.

use crate::order::{PairOrder, Size};
use crate::registry::ColliderRegistry;
use crate::{Colliders, HandlePair, Tree};
use pbig_core::Aabb;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;

/// The version of [`Snapshot`]'s layout. Increased whenever the layout changes.
const VERSION: u32 = 2;

type RawHandle = (u32, u32);

/// Everything that later events depend on. The tree for queries, the device and a shadow are not part of it.
#[derive(Serialize, Deserialize)]
pub struct Snapshot<'a> {
    /// The first field, so that another version is named before its layout is misread.
    #[serde(deserialize_with = "this_version")]
    version: u32,
    core: Cow<'a, pbig_core::BroadPhase>,
    generations: Cow<'a, [u32]>,
    relative_margin: f32,
    adopted: Vec<[RawHandle; 2]>,
    /// Sizes of colliders, which decide the order in pairs.
    sizes: Vec<Size>,
    reversed: Vec<[RawHandle; 2]>,
    /// The next update reads all colliders.
    is_incomplete: bool,
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

impl<T: Tree<Aabb = Aabb>> Colliders<T> {
    /// Returns what to save. `relative_margin` is the adapter's.
    pub fn snapshot(&self, relative_margin: f32) -> Snapshot<'_> {
        let raw = |pair: &HandlePair| [pair.0.into(), pair.1.into()];
        let (sizes, reversed) = self.writer.order.to_saved();
        Snapshot {
            version: VERSION,
            core: Cow::Borrowed(&self.core),
            generations: Cow::Borrowed(self.registry.generations()),
            relative_margin,
            adopted: self.writer.adopted.iter().map(raw).collect(),
            sizes,
            reversed: reversed.iter().map(raw).collect(),
            is_incomplete: self.is_incomplete,
        }
    }
}

impl Snapshot<'_> {
    /// Returns the colliders and the relative margin that were saved.
    ///
    /// # Errors
    /// In words, if they make no sense.
    pub fn restore<T: Tree<Aabb = Aabb>>(self) -> Result<(Colliders<T>, f32), String> {
        let registry = ColliderRegistry::from_generations(self.generations.into_owned());
        let mut restored = Colliders::new(self.core.into_owned());
        let core = &restored.core;
        let mut ids = (0..core.id_count()).filter(|&id| core.contains(id));
        if let Some(id) = ids.find(|&id| registry.handle(id).is_none()) {
            return Err(format!("snapshot: box {id} belongs to no collider"));
        }
        let margin = self.relative_margin;
        if !(margin >= 0.0 && margin.is_finite()) {
            return Err(format!("snapshot: margin {margin} is not a length"));
        }
        restored.registry = registry;
        let pair = |[a, b]: [RawHandle; 2]| HandlePair(a.into(), b.into());
        restored.writer.adopted = self.adopted.into_iter().map(pair).collect();
        restored.writer.keeps_order = true;
        restored.writer.order = PairOrder::from_saved(self.sizes, self.reversed.into_iter().map(pair));
        restored.is_incomplete = self.is_incomplete;
        Ok((restored, margin))
    }
}
