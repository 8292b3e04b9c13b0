//! A world of boxes with its pairs by brute force, and its updates on a device.

use pbig_core::{
    Aabb, ChangeRequest, ChangedBox, DeviceFailure, DeviceFound, Limits, Pair, PairDevice, ProxyFilter,
    oracle,
};
use pbig_gpu::GpuFinder;
use std::collections::{BTreeMap, BTreeSet};

/// The state of a broad phase, in the plainest form.
pub(super) struct DeviceWorld {
    pub(super) boxes: Vec<Aabb>,
    pub(super) filters: Vec<ProxyFilter>,
    pub(super) changed: BTreeMap<u32, ChangedBox>,
    pub(super) kept: BTreeSet<Pair>,
    pub(super) update: u64,
}

impl DeviceWorld {
    pub(super) fn new(boxes: &[Aabb]) -> Self {
        let mut world = Self {
            boxes: Vec::new(),
            filters: Vec::new(),
            changed: BTreeMap::new(),
            kept: BTreeSet::new(),
            update: 0,
        };
        (0u32..).zip(boxes).for_each(|(id, aabb)| world.set(id, *aabb, ProxyFilter::ALL));
        world
    }

    pub(super) fn len(&self) -> u32 {
        self.boxes.len() as u32
    }

    fn note(&mut self, id: u32) {
        let i = id as usize;
        if i >= self.boxes.len() {
            self.boxes.resize(i + 1, Aabb::NOWHERE);
            self.filters.resize(i + 1, ProxyFilter::ALL);
        }
        let was = ChangedBox { id, aabb: self.boxes[i], filter: self.filters[i] };
        self.changed.entry(id).or_insert(was);
    }

    pub(super) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        self.note(id);
        self.boxes[id as usize] = if aabb.is_valid() { aabb } else { Aabb::NOWHERE };
        self.filters[id as usize] = filter;
    }

    pub(super) fn put(&mut self, id: u32, aabb: Aabb) {
        let filter = self.filters.get(id as usize).copied().unwrap_or_default();
        self.set(id, aabb, filter);
    }

    /// Removes a box. Its pairs end without an event.
    pub(super) fn remove(&mut self, id: u32) {
        self.put(id, Aabb::NOWHERE);
        self.changed.entry(id).and_modify(|change| change.aabb = Aabb::NOWHERE);
        self.kept.retain(|pair| pair.a != id && pair.b != id);
    }

    pub(super) fn shift(&mut self, id: u32, by: [f32; 3]) {
        self.put(id, pbig_tests::shifted(&self.boxes[id as usize], by));
    }

    /// Runs an update on a device and compares it with brute force.
    pub(super) fn follow(&mut self, gpu: &mut GpuFinder) -> Result<DeviceFound, DeviceFailure> {
        self.follow_within(gpu, Limits::DEFAULT.max_pairs)
    }

    /// As [`DeviceWorld::follow`], with a limit of pairs.
    pub(super) fn follow_within(
        &mut self,
        gpu: &mut GpuFinder,
        max_pairs: u64,
    ) -> Result<DeviceFound, DeviceFailure> {
        let changed: Vec<_> = self.changed.values().copied().collect();
        let request = ChangeRequest {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &changed,
            kept: self.kept.len() as u64,
            max_pairs,
        };
        let mut found = DeviceFound::default();
        gpu.find_changed(&request, &mut found)?;
        assert_eq!(self.fault(&found), None, "update {}", self.update);
        let pairs = self.completed(&found);
        self.advance();
        assert_eq!(pairs, self.kept, "update {}: what a caller makes of it", self.update);
        Ok(found)
    }

    /// Runs an update without the device.
    pub(super) fn advance(&mut self) {
        self.kept = oracle::pairs_filtered(&self.boxes, &self.filters).into_iter().collect();
        self.changed.clear();
        self.update += 1;
    }

    /// Returns the first difference between the found pairs and those that are in one of the two states only.
    fn fault(&self, found: &DeviceFound) -> Option<String> {
        let mut before = self.boxes.clone();
        for change in self.changed.values() {
            let restarted = found.restarted.contains(&change.id);
            before[change.id as usize] = if restarted { Aabb::NOWHERE } else { change.aabb };
        }
        let pairs = |boxes: &[Aabb]| -> BTreeSet<Pair> {
            oracle::pairs_filtered(boxes, &self.filters).into_iter().collect()
        };
        let overlap = |pair: &&Pair| self.boxes[pair.a as usize].overlaps(&self.boxes[pair.b as usize]);
        if let Some(pair) = found.ended.iter().find(overlap) {
            return Some(format!("{pair:?} has not ended"));
        }
        let wanted: Vec<Pair> = (&pairs(&self.boxes) ^ &pairs(&before)).into_iter().collect();
        let mut pairs = [&found.pairs[..], &found.ended[..]].concat();
        pairs.sort_unstable();
        pbig_tests::difference(&pairs, &wanted)
    }

    /// Returns the pairs after the update, completed as the rules of a search for changes say.
    fn completed(&self, found: &DeviceFound) -> BTreeSet<Pair> {
        let again = |pair: &Pair| [pair.a, pair.b].iter().any(|id| found.restarted.contains(id));
        let overlaps = |pair: &Pair| self.boxes[pair.a as usize].overlaps(&self.boxes[pair.b as usize]);
        let allowed = |pair: &Pair| self.filters[pair.a as usize].allows(&self.filters[pair.b as usize]);
        let mut pairs = self.kept.clone();
        for pair in found.pairs.iter().chain(&found.ended) {
            let news = if overlaps(pair) { pairs.insert(*pair) } else { pairs.remove(pair) };
            assert!(news || again(pair), "{pair:?} is no news");
        }
        pairs.retain(|pair| !again(pair) || (overlaps(pair) && allowed(pair)));
        pairs
    }
}
