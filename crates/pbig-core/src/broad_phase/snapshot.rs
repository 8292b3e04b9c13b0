//! Snapshots: boxes, filters, pairs, pending changes and settings. Grids are built again.
//!
//! Events are a function of these, so a restored broad phase sends the same events. Boxes are saved as bits, which are exact
//! in any format, even in one without NaN or infinity. All that is read is checked: no bytes make later calls panic.

use super::BroadPhase;
use crate::{Backend, Config, Limits, Order, Pair, ProxyFilter};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The version of the format. A snapshot of another version is an error.
const VERSION: u32 = 1;

/// Reads the version, before all other fields.
fn version<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    match u32::deserialize(deserializer)? {
        VERSION => Ok(VERSION),
        other => Err(D::Error::custom(format!(
            "snapshot: format {other}, but this pbig-core reads format {VERSION}; save the world anew"
        ))),
    }
}

/// All lists are by id or sorted, so that equal states have equal bytes.
#[derive(Serialize, Deserialize)]
struct Snapshot {
    #[serde(deserialize_with = "version")]
    version: u32,
    margin: f32,
    backend: Backend,
    order: Order,
    limits: Limits,
    boxes: Vec<[u32; 6]>,
    filters: Vec<ProxyFilter>,
    present: Vec<bool>,
    pairs: Vec<Pair>,
    /// Boxes that have changed since the last update.
    changed: Vec<u32>,
}

impl Serialize for BroadPhase {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let world = &self.world;
        let mut changed: Vec<u32> = world.changed.clone();
        changed.sort_unstable();
        let filter = |id: u32| self.filter(id).copied().unwrap_or_default();
        let ids = world.ids() as u32;
        Snapshot {
            version: VERSION,
            margin: self.config.margin,
            backend: self.config.backend,
            order: self.config.order,
            limits: self.config.limits,
            boxes: world.boxes.iter().map(|aabb| bytemuck::cast(*aabb)).collect(),
            filters: (0..ids).map(filter).collect(),
            present: (0..ids).map(|id| world.contains(id)).collect(),
            pairs: self.pairs().collect(),
            changed,
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for BroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Snapshot::deserialize(deserializer)?.restore().map_err(D::Error::custom)
    }
}

impl Snapshot {
    fn restore(self) -> Result<BroadPhase, String> {
        self.check()?;
        let Self { margin, backend, order, limits, .. } = self;
        let config = Config { margin, backend, order, limits, ..Config::DEFAULT };
        let mut restored = BroadPhase::new(config).map_err(|error| format!("snapshot: {error}"))?;
        let world = &mut restored.world;
        world.reserve_ids(self.boxes.len());
        for (id, _) in self.present.iter().enumerate().filter(|(_, present)| **present) {
            world.insert(id as u32, bytemuck::cast(self.boxes[id]), self.filters[id], 0.0);
        }
        // Only the changes of the snapshot count, not these insertions. Saved pairs are trusted, as those of an update are.
        world.forget_changes();
        world.change(|all| self.changed.iter().for_each(|id| all.note_change(*id)));
        restored.kept.reserve_ids(self.boxes.len());
        restored.kept.apply(&self.pairs, &[]);
        Ok(restored)
    }

    fn check(&self) -> Result<(), String> {
        let ids = self.boxes.len();
        if self.filters.len() != ids || self.present.len() != ids || ids as u64 > Limits::UNLIMITED.max_boxes
        {
            let (filters, present) = (self.filters.len(), self.present.len());
            return Err(format!("snapshot: {ids} boxes, {filters} filters, {present} flags of presence"));
        }
        let is_present = |id: u32| self.present.get(id as usize).is_some_and(|present| *present);
        let is_pair = |pair: &Pair| pair.a < pair.b && is_present(pair.a) && is_present(pair.b);
        if let Some(pair) = self.pairs.iter().find(|pair| !is_pair(pair)) {
            return Err(format!("snapshot: {pair:?} is not a pair of boxes"));
        }
        if let Some(two) = self.pairs.windows(2).find(|two| two[0] >= two[1]) {
            return Err(format!("snapshot: pairs out of order: {two:?}"));
        }
        if let Some(id) = self.changed.iter().find(|id| **id as usize >= ids) {
            return Err(format!("snapshot: box {id} has changed, but there are {ids}"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    #[test]
    fn broken_snapshots_are_errors() {
        let mut whole = BroadPhase::new(Config::DEFAULT).expect("a margin");
        let cube = |id: u32| Aabb::from_center([0.9 * id as f32, 0.0, 0.0], [0.5; 3]);
        (0..90).for_each(|id| whole.set(id, cube(id), ProxyFilter::ALL).expect("a small id"));
        assert_eq!(whole.update().expect("few pairs").added.len(), 89);
        whole.remove(20);
        let good = serde_json::to_value(&whole).expect("a snapshot");
        let broken = |change: &dyn Fn(&mut serde_json::Value)| {
            let mut value = good.clone();
            change(&mut value);
            serde_json::from_value::<BroadPhase>(value).expect_err("an error").to_string()
        };
        assert!(broken(&|v| v["version"] = 7.into()).contains("format 7"));
        assert!(broken(&|v| v["margin"] = (-1.0).into()).contains("margin"));
        assert!(broken(&|v| v["pairs"][0]["a"] = v["pairs"][0]["b"].clone()).contains("not a pair"));
        assert!(broken(&|v| v["pairs"][1]["b"] = 4000.into()).contains("not a pair"));
        let absent = |v: &mut serde_json::Value| {
            let id = v["pairs"][0]["b"].as_u64().expect("an id");
            v["present"][id as usize] = false.into();
        };
        assert!(broken(&absent).contains("not a pair"));
        assert!(broken(&|v| v["pairs"][1] = v["pairs"][0].clone()).contains("out of order"));
        assert!(broken(&|v| v["changed"][0] = 92.into()).contains("has changed"));
        assert!(broken(&|v| _ = v["present"].as_array_mut().expect("a list").pop()).contains("flags"));
    }
}
