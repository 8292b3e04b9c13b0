//! One call on several devices (PBIG section 7): they share its parts, one block of boxes for each and the borders between these.

use super::error::Failure;
use super::job::Job;
use super::search::{Part, parts};
use super::{GpuError, GpuFinder, wait};
use crate::GpuOptions;
use pbig_core::{BoxIds, DeviceFailure, DeviceFound, PairDevice, SearchRequest};

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

    /// Gives the parts to the devices in turn. Returns the answers, each with the index of its part.
    fn find_parts(&mut self, job: &Job<'_>, parts: &[Part]) -> Vec<(usize, Answer)> {
        let count = self.finders.len();
        let take = |(first, finder): (usize, &mut GpuFinder)| -> Vec<_> {
            (first..parts.len()).step_by(count).map(|i| (i, find(finder, job, &parts[i]))).collect()
        };
        std::thread::scope(|scope| {
            let finders = self.finders.iter_mut().enumerate();
            let threads: Vec<_> = finders.map(|own| scope.spawn(|| take(own))).collect();
            let failed = |_| vec![(0, Err(DeviceFailure::Failed("the thread of a device ended".into())))];
            threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(failed)).collect()
        })
    }
}

/// The answer of a device to a part.
type Answer = Result<DeviceFound, DeviceFailure>;

fn find(finder: &mut GpuFinder, job: &Job<'_>, part: &Part) -> Answer {
    let (boxes, filters) = part.boxes_of(job);
    let filters = filters.as_deref();
    let job = Job { boxes: &boxes, filters, split: Some(part.split), is_sorted: false, ..*job };
    let mut found = DeviceFound::default();
    wait::block_on(finder.run(&job, &mut found)).map_err(Failure::for_core)?;
    Ok(found)
}

/// Adds the answer to a part to those before it.
fn add(all: &mut DeviceFound, found: DeviceFound, part: &Part) -> Result<(), DeviceFailure> {
    let fault = |i| DeviceFailure::Failed(format!("pair {i} of a part is not a < b < {}", part.ids.len()));
    all.pairs.append_checked(&found.pairs, BoxIds::Part(&part.ids)).map_err(fault)?;
    all.checks.made += found.checks.made;
    all.checks.redundant += found.checks.redundant;
    all.checks.unnecessary += found.checks.unnecessary;
    let (sum, part) = (&mut all.report, found.report);
    sum.uploaded += part.uploaded;
    sum.downloaded += part.downloaded;
    sum.device_bytes = sum.device_bytes.max(part.device_bytes);
    sum.chunks += part.chunks;
    sum.parts += part.parts;
    sum.repeats += part.repeats;
    (sum.waits, all.plan) = (sum.waits.max(part.waits), found.plan.or_else(|| all.plan.take()));
    Ok(())
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
        let job = Job::all(request);
        let parts = parts(&job, request.boxes.len().div_ceil(self.finders.len()));
        for (i, answer) in self.find_parts(&job, &parts) {
            add(found, answer?, &parts[i])?;
        }
        found.valid = job.valid();
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
