//! What this machine takes for a unit of work: the search itself, on four small scenes, once in a process.

use super::crowding::Set;
use super::found::Found;
use super::judge::Accept;
use super::map::Map;
use super::record::{Item, Record};
use crate::plan::{Costs, LazySummary, Plan, Way};
use crate::{Aabb, Pair};
use std::sync::OnceLock;
use std::time::Instant;

/// Searches of a scene: the first one allocates, the fastest counts.
const ROUNDS: usize = 3;

/// No processor is this many times as fast or as slow as the reference, for these units against each other: more was an
/// interruption.
const MOST: f32 = 4.0;

/// The costs of this machine. The first call takes 0.2 to 0.3 ms.
pub(crate) fn measured() -> &'static Costs {
    static MEASURED: OnceLock<Costs> = OnceLock::new();
    MEASURED.get_or_init(measure)
}

fn measure() -> Costs {
    let reference = Costs::REFERENCE;
    let sorted = |boxes: usize| reference.place * boxes as f32 + reference.grid;
    let test = Scene::of(Way::Brute, &spread(96, 7.0, 0.5)).slowness();
    let place = Scene::of(Way::OneGrid, &spread(256, 10.0, 0.5)).slowness();
    // Small boxes in cells as large as their world, because of a large one: they are sorted, the rest is candidates.
    let mut crowd = spread(255, 1.0, 0.0005);
    crowd.extend(spread(1, 1.0, 0.4));
    let candidate = Scene::of(Way::OneGrid, &crowd).without(sorted(256), place).slowness();
    // Small boxes among a few large ones.
    let mut mixed = spread(128, 20.0, 0.0005);
    mixed.extend(spread(16, 20.0, 2.5));
    let visit = Scene::of(Way::Levels, &mixed).without(sorted(144) + reference.grid, place).slowness();
    Costs {
        test: reference.test * test,
        sweep: reference.sweep * test,
        place: reference.place * place,
        candidate: reference.candidate * candidate,
        visit: reference.visit * visit,
        visited: reference.visited * visit,
        grid: reference.grid * place,
        pair: reference.pair * place,
    }
}

/// A search, in ns.
struct Scene {
    took: f32,
    /// What the reference takes.
    expected: f32,
}

impl Scene {
    fn of(way: Way, boxes: &[Aabb]) -> Self {
        let summary = LazySummary::new(boxes, None);
        let plan = Plan::only(way, summary.get());
        let set = Set { boxes, filters: None, summary: &summary, before: &[] };
        let (mut map, mut found) = (Map::<Probe>::new(), Found::default());
        let mut took = f32::INFINITY;
        for _ in 0..ROUNDS {
            let clock = Instant::now();
            map.build(&plan, &set, u32::MAX);
            let done = map.find(&Every, u64::MAX, &mut found);
            debug_assert!(done.is_ok(), "no limit");
            took = took.min(clock.elapsed().as_nanos() as f32);
        }
        let pairs = Costs::REFERENCE.pair * found.overlaps as f32;
        Self { took, expected: plan.expected.map_or(0.0, |(_, ns)| ns) + pairs }
    }

    /// The rest of it, without a part that takes so many times as long as the reference.
    fn without(self, part: f32, slowness: f32) -> Self {
        Self { took: self.took - slowness * part, expected: self.expected - part }
    }

    fn slowness(&self) -> f32 {
        (self.took / self.expected).clamp(1.0 / MOST, MOST)
    }
}

/// Cubes at places that look random, the same every time.
fn spread(count: usize, edge: f32, half: f32) -> Vec<Aabb> {
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / 16_777_216.0 * edge
    };
    (0..count).map(|_| Aabb::from_center([next(), next(), next()], [half; 3])).collect()
}

/// An [`Item`], and the search compiled once more: called from here, too, the sort of items itself was no longer inlined,
/// and took a tenth longer.
#[derive(Clone, Copy)]
struct Probe(Item);

impl Record for Probe {
    const EMPTY: Self = Self(Item::EMPTY);

    #[inline(always)]
    fn new(item: Item, _: &[Aabb]) -> Self {
        Self(item)
    }

    #[inline(always)]
    fn item(&self) -> &Item {
        &self.0
    }
}

struct Every;

impl Accept for Every {
    fn pair(&self, _: Pair) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_are_measured_once_and_believable() {
        let (costs, reference) = (measured(), Costs::REFERENCE);
        assert!(std::ptr::eq(costs, measured()));
        let all = |c: &Costs| [c.test, c.sweep, c.place, c.candidate, c.visit, c.visited, c.grid, c.pair];
        for (cost, of_reference) in all(costs).into_iter().zip(all(&reference)) {
            assert!((1.0 / MOST..=MOST).contains(&(cost / of_reference)), "{costs:?}");
        }
    }

    #[test]
    fn an_interrupted_measurement_is_kept_within_bounds() {
        let slowness = |took, expected| Scene { took, expected }.slowness();
        assert_eq!([slowness(1e9, 100.0), slowness(0.0, 100.0), slowness(50.0, 100.0)], [4.0, 0.25, 0.5]);
        let scene = Scene { took: 150.0, expected: 100.0 }.without(50.0, 2.0);
        assert_eq!(scene.slowness(), 1.0);
    }
}
