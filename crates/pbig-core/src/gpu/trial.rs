//! [`crate::Backend::Auto`] with a device at hand: the CPU or the GPU, by measurement.

use crate::plan::NoGpu;
use std::time::Duration;

/// Boxes from which a device is tried at all: below, a submission alone takes as long as the CPU does
/// (50 to 100 us against 1 ms for 10,000 boxes on one core).
const WORTH_TRYING: usize = 10_000;
/// The first calls of a device are not counted: they compile kernels, allocate and upload everything.
const WARM_UP: u32 = 2;
/// Calls after which the other side is tried again.
const AGAIN: u32 = 256;
/// How much faster the other side must be: the choice does not flap.
const BETTER: f64 = 0.8;

/// Time per box of both sides.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trial {
    cpu: Option<f64>,
    gpu: Option<f64>,
    warm_up: u32,
    on_gpu: bool,
    calls: u32,
}

impl Trial {
    /// Whether the next call should run on the device, and why not.
    pub(crate) fn wants_gpu(&mut self, boxes: usize) -> Result<(), NoGpu> {
        if boxes < WORTH_TRYING {
            return Err(NoGpu::FewBoxes);
        }
        let Some(cpu) = self.cpu else { return Err(NoGpu::Unmeasured) };
        let Some(gpu) = self.gpu else { return Ok(()) };
        let (here, there) = if self.on_gpu { (gpu, cpu) } else { (cpu, gpu) };
        if there < BETTER * here {
            self.on_gpu = !self.on_gpu;
            self.calls = 0;
        }
        self.calls += 1;
        match (self.on_gpu, self.calls.is_multiple_of(AGAIN)) {
            (true, false) | (false, true) => Ok(()),
            (true, true) => Err(NoGpu::Compared),
            (false, false) => Err(NoGpu::Slower),
        }
    }

    /// What a call took.
    pub(crate) fn note(&mut self, on_gpu: bool, boxes: usize, time: Duration) {
        if boxes < WORTH_TRYING {
            return;
        }
        if on_gpu && self.warm_up < WARM_UP {
            self.warm_up += 1;
            return;
        }
        let per_box = time.as_secs_f64() / boxes as f64;
        let side = if on_gpu { &mut self.gpu } else { &mut self.cpu };
        *side = Some(side.map_or(per_box, |before| 0.75 * before + 0.25 * per_box));
    }

    /// What the GPU takes of the CPU's time, once both are known, for so many boxes that it decides.
    pub(crate) fn share_of_gpu(&self, boxes: usize) -> Option<f32> {
        if boxes < WORTH_TRYING { None } else { Some((self.gpu? / self.cpu?) as f32) }
    }

    /// The device has failed: it must prove itself again.
    pub(crate) fn failed(&mut self) {
        *self = Self { cpu: self.cpu, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs calls with the given times in ns a box, and counts those on the GPU.
    fn on_gpu(trial: &mut Trial, calls: u32, boxes: usize, cpu: u64, gpu: u64) -> u32 {
        let mut count = 0;
        for _ in 0..calls {
            let wants = trial.wants_gpu(boxes).is_ok();
            count += u32::from(wants);
            trial.note(wants, boxes, Duration::from_nanos(boxes as u64 * if wants { gpu } else { cpu }));
        }
        count
    }

    #[test]
    fn the_faster_side_gets_the_calls_and_the_other_is_tried_now_and_then() {
        let mut trial = Trial::default();
        assert_eq!(on_gpu(&mut trial, 100, 9_999, 100, 1), 0, "too few boxes");
        assert_eq!(trial.wants_gpu(9_999), Err(NoGpu::FewBoxes));
        assert_eq!(trial.wants_gpu(100_000), Err(NoGpu::Unmeasured));
        assert_eq!(trial.share_of_gpu(100_000), None);
        assert!(on_gpu(&mut trial, 1000, 100_000, 100, 10) > 990);
        assert_eq!((trial.share_of_gpu(100_000), trial.share_of_gpu(9999)), (Some(0.1), None));
        let mut trial = Trial::default();
        assert!(on_gpu(&mut trial, 1000, 100_000, 100, 95) < 12, "not enough better");
        assert_eq!(trial.wants_gpu(100_000), Err(NoGpu::Slower));
        assert!(on_gpu(&mut trial, 10_000, 100_000, 100, 10) > 8000, "noticed when it becomes better");
        let whys = (0..AGAIN).filter_map(|_| trial.wants_gpu(100_000).err()).collect::<Vec<_>>();
        assert_eq!(whys, [NoGpu::Compared], "one call in so many is the CPU's");
        trial.failed();
        assert_eq!(on_gpu(&mut trial, 1, 100_000, 100, 10), 1, "tried again");
    }
}
