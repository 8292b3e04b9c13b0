//! Saving and restoring: the boxes, their pairs and what has changed; grids are built again.
//!
//! Events are a function of just that, so a restored broad phase goes on with the same bytes. Boxes
//! are saved as bits: exact in any format, also where it has no NaN or infinity. Whatever is restored has been
//! checked: no bytes make later calls panic.

use super::{BroadPhase, Old, flag};
use crate::{Aabb, Config, Pair, ProxyFilter};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

type Bits = [u32; 6];

fn to_bits(aabb: &Aabb) -> Bits {
    bytemuck::cast(*aabb)
}

/// All by id or sorted, so that equal states have equal bytes.
#[derive(Serialize, Deserialize)]
struct Snapshot<'a> {
    config: Config,
    boxes: Vec<Bits>,
    filters: Cow<'a, [ProxyFilter]>,
    present: Vec<bool>,
    pairs: Vec<Pair>,
    changed: Vec<(u32, Bits, ProxyFilter)>,
}

impl Serialize for BroadPhase {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut pairs: Vec<Pair> = self.pairs().collect();
        pairs.sort_unstable();
        // In the order of ids: the other order depends on who has set them.
        let mut changed: Vec<u32> = self.changed.clone();
        changed.sort_unstable();
        Snapshot {
            config: self.config,
            boxes: self.boxes.iter().map(to_bits).collect(),
            filters: Cow::Borrowed(&self.filters),
            present: self.flags.iter().map(|flags| flags & flag::PRESENT != 0).collect(),
            pairs,
            changed: changed.into_iter().map(|id| self.saved_change(id)).collect(),
        }
        .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for BroadPhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Snapshot::deserialize(deserializer)?.restore().map_err(D::Error::custom)
    }
}

impl BroadPhase {
    /// What a changed box was.
    fn saved_change(&self, id: u32) -> (u32, Bits, ProxyFilter) {
        let now = Old { aabb: self.before[id as usize], filter: self.filters[id as usize] };
        let old = self.refiltered.get(&id).copied().unwrap_or(now);
        (id, to_bits(&old.aabb), old.filter)
    }

    fn restore_change(&mut self, id: u32, old: Old) {
        let i = id as usize;
        self.note_change(id);
        self.before[i] = old.aabb;
        if old.filter != self.filters[i] {
            self.flags[i] |= flag::REFILTERED;
            self.before[i] = Aabb::NOWHERE;
            self.refiltered.insert(id, old);
        }
    }
}

impl Snapshot<'_> {
    fn restore(self) -> Result<BroadPhase, String> {
        self.check()?;
        let mut restored = BroadPhase::new(self.config).map_err(|error| error.to_string())?;
        let ids = self.boxes.len();
        restored.make_room(ids);
        for i in 0..ids {
            let aabb: Aabb = bytemuck::cast(self.boxes[i]);
            // Whatever is invalid or absent is stored as nowhere, as everywhere else.
            restored.boxes[i] = if self.present[i] && aabb.is_valid() { aabb } else { Aabb::NOWHERE };
        }
        let valid = restored.boxes.iter().filter(|aabb| aabb.is_valid()).count();
        restored.present_count = self.present.iter().filter(|present| **present).count() as u32;
        restored.invalid_count = restored.present_count - valid as u32;
        restored.filters = self.filters.into_owned();
        restored.before.clone_from(&restored.boxes);
        for (flags, present) in restored.flags.iter_mut().zip(&self.present) {
            *flags = if *present { flag::PRESENT } else { 0 };
        }
        restored.pairs.insert(&self.pairs);
        for (id, bits, filter) in self.changed {
            restored.restore_change(id, Old { aabb: bytemuck::cast(bits), filter });
        }
        Ok(restored)
    }

    fn check(&self) -> Result<(), String> {
        let ids = self.boxes.len();
        if self.filters.len() != ids || self.present.len() != ids || ids > 1 << 31 {
            let (filters, present) = (self.filters.len(), self.present.len());
            return Err(format!("snapshot: {ids} boxes, {filters} filters, {present} flags of presence"));
        }
        let known = |id: u32| (id as usize) < ids;
        let present = |id: u32| known(id) && self.present[id as usize];
        let kept = |pair: &Pair| pair.a < pair.b && present(pair.a) && present(pair.b);
        if let Some(pair) = self.pairs.iter().find(|pair| !kept(pair)) {
            return Err(format!("snapshot: {pair:?} is no pair of boxes"));
        }
        if let Some(two) = self.pairs.windows(2).find(|two| two[0] >= two[1]) {
            return Err(format!("snapshot: pairs out of order: {two:?}"));
        }
        if let Some((id, ..)) = self.changed.iter().find(|(id, ..)| !known(*id)) {
            return Err(format!("snapshot: box {id} has changed, but there are {ids}"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes in a row, of which some move each round.
    fn play(broad_phase: &mut BroadPhase, round: u32) -> crate::Events {
        for id in 0..40u32 {
            let x = (id * 7 % 40) as f32 + if id % 3 == round % 3 { round as f32 * 0.4 } else { 0.0 };
            let aabb = match (id, round) {
                (5, _) => Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]),
                (6, 2) => Aabb::NOWHERE,
                _ => Aabb::from_center([x, 0.0, 0.0], [0.6; 3]),
            };
            let filter = ProxyFilter { body: id / 2, ..ProxyFilter::ALL };
            broad_phase.set(id, aabb, filter).expect("few boxes");
        }
        broad_phase.remove(round * 3);
        let events = broad_phase.update().expect("few pairs").clone();
        // Changes that the next update will see.
        broad_phase.remove(round + 20);
        events
    }

    fn saved(broad_phase: &BroadPhase) -> String {
        serde_json::to_string(broad_phase).expect("a snapshot")
    }

    #[test]
    fn a_restored_broad_phase_goes_on_with_the_same_events() {
        [crate::Strategy::Grid, crate::Strategy::Auto].into_iter().for_each(goes_on);
    }

    fn goes_on(strategy: crate::Strategy) {
        let config = Config { margin: 0.05, strategy, ..Config::DEFAULT };
        let mut kept = BroadPhase::new(config).expect("a margin");
        let mut events = 0;
        for round in 0..12 {
            let mut restored: BroadPhase = serde_json::from_str(&saved(&kept)).expect("a restored one");
            assert_eq!(saved(&restored), saved(&kept));
            let wanted = play(&mut kept, round);
            assert_eq!(play(&mut restored, round), wanted);
            assert_eq!(restored.report().invalid, kept.report().invalid);
            events += wanted.added.len() + wanted.removed.len();
            kept = if round % 2 == 0 { restored } else { kept };
        }
        assert!(events > 100, "{events} events");
    }

    #[test]
    fn broken_snapshots_are_errors() {
        let mut whole = BroadPhase::new(Config::DEFAULT).expect("a margin");
        for round in 0..3 {
            play(&mut whole, round);
        }
        let good: serde_json::Value = serde_json::from_str(&saved(&whole)).expect("JSON");
        let broken = |change: &dyn Fn(&mut serde_json::Value)| {
            let mut value = good.clone();
            change(&mut value);
            serde_json::from_value::<BroadPhase>(value).expect_err("an error").to_string()
        };
        assert!(broken(&|v| v["config"]["margin"] = (-1.0).into()).contains("margin"));
        assert!(broken(&|v| v["pairs"][0]["a"] = v["pairs"][0]["b"].clone()).contains("no pair"));
        assert!(broken(&|v| v["pairs"][1]["b"] = 4000.into()).contains("no pair"));
        assert!(broken(&|v| v["pairs"][1] = v["pairs"][0].clone()).contains("out of order"));
        assert!(broken(&|v| v["changed"][0][0] = 42.into()).contains("has changed"));
        assert!(broken(&|v| _ = v["present"].as_array_mut().expect("a list").pop()).contains("flags"));
    }
}
