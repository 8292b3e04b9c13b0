//! One call on several devices (PBIG section 7): each gets a slab of the space, with the boxes that reach into it.

use super::search::{name_pairs, of_ids, widest_axis};
use super::{GpuError, GpuFinder};
use crate::GpuOptions;
use crate::layout::ordered;
use crate::pbig::sampled;
use pbig_core::{Aabb, DeviceFailure, DeviceFound, PairDevice, SearchRequest};

/// Fewest boxes for which a second device is asked.
const FEWEST_BOXES: usize = 2048;

/// Several devices that share the boxes of a call.
#[derive(Clone, Debug)]
pub struct GpuFinders {
    pub(super) finders: Vec<GpuFinder>,
    name: String,
}

impl GpuFinders {
    /// Opens a device on each adapter, see [`crate::adapters`]. They should be about equally fast: each gets as many boxes.
    /// A GPU that two APIs offer, as Vulkan and DirectX 12, is two adapters: give one of them.
    ///
    /// # Errors
    /// As [`GpuFinder::on`], and if there is no adapter.
    pub fn on_all(adapters: &[wgpu::Adapter]) -> Result<Self, GpuError> {
        let finders: Vec<_> = adapters.iter().map(GpuFinder::on).collect::<Result<_, _>>()?;
        if finders.is_empty() {
            return Err(GpuError::NoAdapter(String::new()));
        }
        let name = finders.iter().map(GpuFinder::adapter).collect::<Vec<_>>().join(" and ");
        Ok(Self { finders, name })
    }

    /// Returns the finders with other settings.
    pub fn with_options(self, options: GpuOptions) -> Self {
        let finders = self.finders.into_iter().map(|finder| finder.with_options(options)).collect();
        Self { finders, ..self }
    }

    /// Gives a slab to each device. Returns the answers, whose pairs have the ids of the caller.
    fn find_slabs(&mut self, request: &SearchRequest<'_>) -> Vec<Result<DeviceFound, DeviceFailure>> {
        std::thread::scope(|scope| {
            let slabs = slabs(request.boxes, self.finders.len()).into_iter();
            let with_finders = slabs.zip(&mut self.finders);
            let threads: Vec<_> =
                with_finders.map(|(slab, finder)| scope.spawn(move || slab.find(finder, request))).collect();
            let failed = |_| Err(DeviceFailure::Failed("the thread of a device ended".into()));
            threads.into_iter().map(|thread| thread.join().unwrap_or_else(failed)).collect()
        })
    }
}

/// The space of one device. A box is the slab's own if its lower corner is there.
struct Slab {
    axis: usize,
    /// First coordinate of the slab, and first one beyond it, in ordered integers.
    begin: i32,
    end: i32,
}

impl Slab {
    /// Finds the pairs whose later box is the slab's own, among the boxes that reach into the slab.
    fn find(
        &self,
        finder: &mut GpuFinder,
        request: &SearchRequest<'_>,
    ) -> Result<DeviceFound, DeviceFailure> {
        let is_own = |id: u32| ordered(request.boxes[id as usize].min[self.axis]) >= self.begin;
        let ids = self.ids(request.boxes);
        let (boxes, filters) = (of_ids(request.boxes, &ids), request.filters.map(|all| of_ids(all, &ids)));
        let part = SearchRequest { boxes: &boxes, filters: filters.as_deref(), is_sorted: false, ..*request };
        let mut found = DeviceFound::default();
        finder.find_all(&part, &mut found).map_err(|failure| match failure {
            // Some of them may belong to an earlier slab: the CPU counts exactly.
            DeviceFailure::TooManyPairs => DeviceFailure::Declined("too many pairs in a slab".into()),
            other => other,
        })?;
        name_pairs(&mut found.pairs, &ids);
        found.pairs.retain(|pair| is_own(pair.a) || is_own(pair.b));
        found.valid = ids.iter().filter(|&&id| is_own(id)).count() as u32;
        Ok(found)
    }

    /// Returns the ids of the valid boxes that reach into the slab.
    fn ids(&self, boxes: &[Aabb]) -> Vec<u32> {
        let reaches =
            |one: &Aabb| ordered(one.min[self.axis]) < self.end && ordered(one.max[self.axis]) >= self.begin;
        let ids = (0..).zip(boxes).filter(|(_, one)| one.is_valid() && reaches(one));
        ids.map(|(id, _)| id).collect()
    }
}

/// Returns slabs with about equally many boxes of their own, along the axis on which they are spread most.
fn slabs(boxes: &[Aabb], count: usize) -> Vec<Slab> {
    let sample = sampled(boxes);
    let axis = widest_axis(&sample);
    let mut corners: Vec<i32> = sample.iter().map(|one| ordered(one.min[axis])).collect();
    corners.sort_unstable();
    let inner = (1..count).map(|i| corners.get(i * corners.len() / count).copied().unwrap_or(0));
    let mut borders: Vec<i32> = [i32::MIN].into_iter().chain(inner).chain([i32::MAX]).collect();
    // Boxes with one corner are not parted.
    borders.dedup();
    borders.windows(2).map(|two| Slab { axis, begin: two[0], end: two[1] }).collect()
}

/// Adds the answer of a slab to those before it.
fn add(all: &mut DeviceFound, mut slab: DeviceFound) {
    all.pairs.append(&mut slab.pairs);
    all.valid += slab.valid;
    all.checks.made += slab.checks.made;
    all.checks.redundant += slab.checks.redundant;
    all.checks.unnecessary += slab.checks.unnecessary;
    let (sum, part) = (&mut all.report, slab.report);
    sum.uploaded += part.uploaded;
    sum.downloaded += part.downloaded;
    sum.device_bytes += part.device_bytes;
    sum.chunks += part.chunks;
    sum.parts += part.parts;
    sum.repeats += part.repeats;
    (sum.waits, all.plan) = (sum.waits.max(part.waits), slab.plan.or_else(|| all.plan.take()));
}

impl PairDevice for GpuFinders {
    fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        if self.finders.len() < 2 || request.boxes.len() < FEWEST_BOXES {
            return self.finders[0].find_all(request, found);
        }
        for answer in self.find_slabs(request) {
            add(found, answer?);
        }
        let is_too_many = found.pairs.len() as u64 > request.max_pairs;
        if is_too_many { Err(DeviceFailure::TooManyPairs) } else { Ok(()) }
    }

    fn name(&self) -> Option<&str> {
        self.finders.iter().all(|finder| finder.name().is_some()).then_some(&self.name)
    }

    fn is_software(&self) -> bool {
        self.finders.iter().any(GpuFinder::is_software)
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}
