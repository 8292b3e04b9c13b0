//! One call on several devices (PBIG section 7): each gets a slab of the boxes, and those that reach into it from before.

use super::search::{name_pairs, of_ids, sorted};
use super::{GpuError, GpuFinder};
use crate::GpuOptions;
use crate::layout::ordered;
use pbig_core::{Aabb, ChangeRequest, DeviceFailure, DeviceFound, PairDevice, SearchRequest};

/// Fewest boxes for which a second device is asked.
const FEWEST_BOXES: usize = 2048;

/// Several devices that share the boxes of a search for all pairs. Updates go to the first one.
#[derive(Clone, Debug)]
pub struct GpuFinders {
    finders: Vec<GpuFinder>,
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
            return Err(GpuError::NoAdapter { wanted: String::new(), found: "none".into() });
        }
        let name = finders.iter().map(GpuFinder::adapter).collect::<Vec<_>>().join(" and ");
        Ok(Self { finders, name })
    }

    /// Returns the finders with other settings.
    pub fn with_options(self, options: GpuOptions) -> Self {
        let finders = self.finders.into_iter().map(|finder| finder.with_options(options)).collect();
        Self { finders, ..self }
    }

    /// Gives each slab to a device. Returns the answers, whose pairs have the ids of the caller.
    fn find_slabs(
        &mut self,
        request: &SearchRequest<'_>,
        slabs: &[Slab],
    ) -> Vec<Result<DeviceFound, DeviceFailure>> {
        std::thread::scope(|scope| {
            let with_finders = slabs.iter().zip(&mut self.finders);
            let threads: Vec<_> =
                with_finders.map(|(slab, finder)| scope.spawn(|| slab.find(finder, request))).collect();
            let failed = |_| Err(DeviceFailure::Failed("the thread of a device ended".into()));
            threads.into_iter().map(|thread| thread.join().unwrap_or_else(failed)).collect()
        })
    }
}

/// The boxes of one device.
struct Slab {
    /// Ids of boxes: first those of earlier slabs that reach into this one.
    ids: Vec<u32>,
    /// Number of boxes of earlier slabs.
    earlier: u32,
}

impl Slab {
    /// Finds the pairs with at least one box of the slab's own. The other pairs belong to earlier slabs.
    fn find(
        &self,
        finder: &mut GpuFinder,
        request: &SearchRequest<'_>,
    ) -> Result<DeviceFound, DeviceFailure> {
        let boxes = of_ids(request.boxes, &self.ids);
        let filters = request.filters.map(|all| of_ids(all, &self.ids));
        let filters = filters.as_deref();
        let mut found = DeviceFound::default();
        let part = SearchRequest { boxes: &boxes, filters, is_sorted: false, ..*request };
        match finder.find_all(&part, &mut found) {
            // Some of them may belong to an earlier slab: the CPU counts exactly.
            Err(DeviceFailure::TooManyPairs) => {
                Err(DeviceFailure::Declined("too many pairs in a slab".into()))
            }
            Err(failure) => Err(failure),
            Ok(()) => {
                found.pairs.retain(|pair| pair.b >= self.earlier);
                name_pairs(&mut found.pairs, &self.ids);
                Ok(found)
            }
        }
    }
}

/// Cuts the boxes into slabs with equally many of their own, along the axis on which they are spread most.
fn slabs(boxes: &[Aabb], count: usize) -> Vec<Slab> {
    let (ids, axis) = sorted(boxes);
    let size = ids.len().div_ceil(count).max(1);
    let slab = |(i, own): (usize, &[u32])| {
        let begin = ordered(boxes[own[0] as usize].min[axis]);
        let reaches = |id: &&u32| ordered(boxes[**id as usize].max[axis]) >= begin;
        let mut all: Vec<u32> = ids[..i * size].iter().filter(reaches).copied().collect();
        let earlier = all.len() as u32;
        all.extend(own);
        Slab { ids: all, earlier }
    };
    ids.chunks(size).enumerate().map(slab).collect()
}

/// Adds the answer of a slab to those before it.
fn add(all: &mut DeviceFound, mut slab: DeviceFound) {
    all.pairs.append(&mut slab.pairs);
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
        let slabs = slabs(request.boxes, self.finders.len());
        for answer in self.find_slabs(request, &slabs) {
            add(found, answer?);
        }
        found.valid = slabs.iter().map(|slab| slab.ids.len() as u32 - slab.earlier).sum();
        let is_too_many = found.pairs.len() as u64 > request.max_pairs;
        if is_too_many { Err(DeviceFailure::TooManyPairs) } else { Ok(()) }
    }

    fn find_changed(
        &mut self,
        request: &ChangeRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        self.finders[0].find_changed(request, found)
    }

    fn forget(&mut self) {
        self.finders[0].forget();
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
