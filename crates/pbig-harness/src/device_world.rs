//! A world of boxes with its pairs by brute force, and its updates on a device.

use crate::boxes::shifted;
use crate::corpus::difference;
use pbig_core::{
    Aabb, ChangeRequest, ChangedBox, DeviceFailure, DeviceFound, Limits, Pair, PairDevice, ProxyFilter,
    oracle,
};
use rand::RngExt;
use rand::rngs::StdRng;
use std::collections::{BTreeMap, BTreeSet};

/// The state of a broad phase, in the plainest form.
#[derive(Debug, Default)]
pub struct DeviceWorld {
    pub boxes: Vec<Aabb>,
    pub filters: Vec<ProxyFilter>,
    pub changed: BTreeMap<u32, ChangedBox>,
    /// The pairs of the last update, without those that a removal has ended.
    pub kept: BTreeSet<Pair>,
    pub update: u64,
}

impl DeviceWorld {
    pub fn new(boxes: &[Aabb]) -> Self {
        let mut world = Self::default();
        (0u32..).zip(boxes).for_each(|(id, aabb)| world.set(id, *aabb, ProxyFilter::ALL));
        world
    }

    /// Returns a world of cubes at random places, for [`DeviceWorld::disturb`].
    pub fn random(boxes: usize, rng: &mut StdRng) -> Self {
        let cube = |_| Aabb::from_center(std::array::from_fn(|_| rng.random_range(0.0..11.0)), [0.7; 3]);
        Self::new(&(0..boxes).map(cube).collect::<Vec<_>>())
    }

    #[allow(clippy::len_without_is_empty, reason = "a number of ids")]
    pub fn len(&self) -> u32 {
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

    pub fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        self.note(id);
        self.boxes[id as usize] = if aabb.is_valid() { aabb } else { Aabb::NOWHERE };
        self.filters[id as usize] = filter;
    }

    /// Sets a box, which keeps its filter.
    pub fn put(&mut self, id: u32, aabb: Aabb) {
        let filter = self.filters.get(id as usize).copied().unwrap_or_default();
        self.set(id, aabb, filter);
    }

    /// Removes a box. Its pairs end without an event.
    pub fn remove(&mut self, id: u32) {
        self.put(id, Aabb::NOWHERE);
        self.changed.entry(id).and_modify(|change| change.aabb = Aabb::NOWHERE);
        self.kept.retain(|pair| pair.a != id && pair.b != id);
    }

    pub fn shift(&mut self, id: u32, by: [f32; 3]) {
        self.put(id, shifted(&self.boxes[id as usize], by));
    }

    /// Changes a box in one of many ways.
    pub fn disturb(&mut self, rng: &mut StdRng) {
        let id = rng.random_range(0..self.len() + 2);
        let at: [f32; 3] = std::array::from_fn(|_| rng.random_range(-1.0..12.0));
        let half = [rng.random_range(0.1..1.5), rng.random_range(0.1f32..1.5), 0.5];
        let filter = ProxyFilter { body: id / 2, mask: 1 << rng.random_range(0..3), ..ProxyFilter::ALL };
        match rng.random_range(0..14) {
            0 => self.put(id, Aabb::from_center(at, half)),
            1 => self.put(id, Aabb::NOWHERE),
            2 => self.put(id, Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, at[1], f32::INFINITY])),
            3 => self.put(id, Aabb::from_center(at, [30.0; 3])),
            4 => self.put(id, Aabb::new([f32::INFINITY; 3], [f32::INFINITY; 3])),
            5 => self.put(id, Aabb::from_center([1e30, -3e38, at[2]], half)),
            6 => self.remove(id),
            7 => self.set(id, Aabb::from_center(at, half), filter),
            8 if id < self.len() => self.set(id, self.boxes[id as usize], filter),
            9 if id < self.len() => self.put(id, self.boxes[id as usize]),
            _ if id < self.len() => self.shift(id, at.map(|x| 0.04 * x)),
            _ => {}
        }
    }

    /// Runs an update on a device, and compares it with brute force.
    ///
    /// # Panics
    /// If the device is wrong.
    pub fn follow(&mut self, device: &mut dyn PairDevice) -> Result<DeviceFound, DeviceFailure> {
        self.follow_within(device, Limits::DEFAULT.max_pairs)
    }

    /// As [`DeviceWorld::follow`], with a limit of pairs.
    ///
    /// # Panics
    /// If the device is wrong.
    pub fn follow_within(
        &mut self,
        device: &mut dyn PairDevice,
        max_pairs: u64,
    ) -> Result<DeviceFound, DeviceFailure> {
        let changed = self.changes();
        let mut found = DeviceFound::default();
        device.find_changed(&ChangeRequest { max_pairs, ..self.request(&changed) }, &mut found)?;
        self.take(&found).unwrap_or_else(|why| panic!("update {}: {why}", self.update));
        Ok(found)
    }

    /// Returns the changed boxes, for [`DeviceWorld::request`].
    pub fn changes(&self) -> Vec<ChangedBox> {
        self.changed.values().copied().collect()
    }

    /// Returns the request of an update.
    pub fn request<'a>(&'a self, changed: &'a [ChangedBox]) -> ChangeRequest<'a> {
        let Self { boxes, filters, kept, .. } = self;
        let max_pairs = Limits::DEFAULT.max_pairs;
        ChangeRequest { boxes, filters, changed, kept: kept.len() as u64, max_pairs }
    }

    /// Takes the answer of a device, and compares it with brute force.
    ///
    /// # Errors
    /// The first difference.
    pub fn take(&mut self, found: &DeviceFound) -> Result<(), String> {
        if let Some(fault) = self.fault(found) {
            return Err(fault);
        }
        let pairs = self.completed(found)?;
        self.advance();
        if pairs == self.kept { Ok(()) } else { Err("a caller makes other pairs of it".into()) }
    }

    /// Runs an update without the device.
    pub fn advance(&mut self) {
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
        difference(&pairs, &wanted)
    }

    /// Returns the pairs after the update, completed as the rules of a search for changes say.
    fn completed(&self, found: &DeviceFound) -> Result<BTreeSet<Pair>, String> {
        let again = |pair: &Pair| [pair.a, pair.b].iter().any(|id| found.restarted.contains(id));
        let overlaps = |pair: &Pair| self.boxes[pair.a as usize].overlaps(&self.boxes[pair.b as usize]);
        let allowed = |pair: &Pair| self.filters[pair.a as usize].allows(&self.filters[pair.b as usize]);
        let mut pairs = self.kept.clone();
        for pair in found.pairs.iter().chain(&found.ended) {
            let is_news = if overlaps(pair) { pairs.insert(*pair) } else { pairs.remove(pair) };
            if !is_news && !again(pair) {
                return Err(format!("{pair:?} is no news"));
            }
        }
        pairs.retain(|pair| !again(pair) || (overlaps(pair) && allowed(pair)));
        Ok(pairs)
    }
}
