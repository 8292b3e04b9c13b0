//! A search from nothing by whatever strategy the plan chooses, on whatever backend there is.

use crate::cpu::crowding::Set;
use crate::cpu::found::Found;
use crate::cpu::judge::Accept;
use crate::cpu::map::Map;
use crate::cpu::pbig::PbigGrid;
use crate::cpu::record::Record;
#[cfg(feature = "gpu")]
use crate::gpu::{self, ChangeRequest, GpuFinder};
use crate::gpu_choice::{self, AvailableDevice, Choice};
#[cfg(feature = "gpu")]
use crate::plan::Chosen;
use crate::plan::{Costs, LazySummary, NoGpu, Plan, Summary};
use crate::report::{Checks, Report, lap, stage};
use crate::{Aabb, Backend, Config, Error, Pair, ProxyFilter, Strategy};
#[cfg(feature = "gpu")]
use std::time::Duration;
use std::time::Instant;

/// Which pairs are wanted, besides that they overlap.
pub(crate) struct Rule<'a, A> {
    /// The whole rule.
    pub(crate) accept: &'a A,
    /// The part of it that a device can test, and that tells who never pairs.
    pub(crate) filters: Option<&'a [ProxyFilter]>,
    /// By id: what a box was at the last update, for a search that keeps it.
    pub(crate) before: &'a [Aabb],
}

/// A search from nothing by whatever strategy the plan chooses, with its buffers.
#[derive(Clone, Debug)]
pub(crate) struct Search<R> {
    pub(crate) map: Map<R>,
    pbig: PbigGrid,
    pub(crate) found: Found,
    /// Memory for a summary.
    pub(crate) spare: Option<Summary>,
    warned: bool,
    #[cfg(feature = "gpu")]
    pub(crate) gpu: Option<GpuFinder>,
}

impl<R: Record> Search<R> {
    pub(crate) fn new() -> Self {
        Self {
            map: Map::new(),
            pbig: PbigGrid::default(),
            found: Found::default(),
            spare: None,
            warned: false,
            #[cfg(feature = "gpu")]
            gpu: None,
        }
    }

    /// Leaves the accepted pairs in `found`, and what was done in `report`.
    pub(crate) fn find<A>(
        &mut self,
        boxes: &[Aabb],
        config: &Config,
        rule: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        report.boxes = boxes.len() as u64;
        let summary = LazySummary::new(boxes, self.spare.take());
        let wanted = self.wants_gpu(config, boxes.len());
        #[cfg(feature = "gpu")]
        let on_gpu = match wanted {
            Ok(()) => self.find_on_gpu(boxes, config, rule, report),
            Err(_) => Ok(false),
        };
        #[cfg(not(feature = "gpu"))]
        let on_gpu = Ok(self.miss_gpu(config, report));
        let found = match on_gpu {
            Ok(false) => self.find_without_gpu(boxes, &summary, config, rule, report),
            done => done.map(drop),
        };
        self.spare = summary.into_spare();
        report.plan.no_gpu = wanted.err().flatten();
        found
    }

    /// The same on the CPU.
    pub(crate) fn find_without_gpu<A>(
        &mut self,
        boxes: &[Aabb],
        summary: &LazySummary<'_>,
        config: &Config,
        rule: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        self.find_into(None, boxes, summary, config, rule, report)
    }

    /// The same, into one empty buffer if there is one, in no particular order.
    pub(crate) fn find_into<A>(
        &mut self,
        all: Option<&mut Vec<Pair>>,
        boxes: &[Aabb],
        summary: &LazySummary<'_>,
        config: &Config,
        rule: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        let set = Set { boxes, filters: rule.filters, summary, before: rule.before };
        self.find_on_cpu(all, &set, config, rule.accept, report)
    }

    fn find_on_cpu<A>(
        &mut self,
        all: Option<&mut Vec<Pair>>,
        set: &Set<'_>,
        config: &Config,
        accept: &A,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        if config.strategy == Strategy::Pbig && config.backend != Backend::Brute {
            let summary = set.summary.get();
            report.plan = Plan::new(summary, config, 1.0);
            report.invalid = set.boxes.len() as u64 - u64::from(summary.valid);
            self.find_pbig(set.boxes, config, accept, report)?;
            if let Some(all) = all {
                self.found.chunks.iter().for_each(|chunk| all.extend_from_slice(chunk));
            }
            return Ok(());
        }
        report.plan = self.map.plan_and_build(set, config, &mut report.stages);
        report.invalid = u64::from(self.map.invalid);
        let mut clock = Instant::now();
        let limit = config.limits.max_pairs;
        match all {
            Some(all) => self.map.find_all(accept, limit, &mut self.found, all)?,
            None => self.map.find(accept, limit, &mut self.found)?,
        }
        report.stages.check += lap(&mut clock);
        report.plan.looks = self.map.looks();
        report.checks = single_entry_checks(&self.found);
        self.learn(report);
        Ok(())
    }

    /// What the search took corrects what is expected of the next one. Pairs cost the same whichever way they are found.
    fn learn(&mut self, report: &Report) {
        let Some(expected) = report.plan.expected else { return };
        let took = (report.stages.map + report.stages.check).as_nanos() as f32;
        let pairs = Costs::REFERENCE.pair * self.found.overlaps as f32;
        self.map.experience.note(expected, (took - pairs).max(0.0));
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn adapter(&self) -> Option<&str> {
        self.gpu.as_ref().and_then(GpuFinder::working_adapter)
    }

    /// Searches on a device; false when it could not do it, which the report then says (contract 8).
    #[cfg(feature = "gpu")]
    fn find_on_gpu<A>(
        &mut self,
        boxes: &[Aabb],
        config: &Config,
        rule: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<bool, Error>
    where
        A: Accept,
    {
        stage!("gpu");
        let clock = Instant::now();
        let request = gpu::SearchRequest { boxes, filters: rule.filters, config };
        let found = self.gpu.get_or_insert_with(GpuFinder::shared).find(&request);
        let done = self.settle(found, clock, report)?;
        report.invalid = done.as_ref().map_or(0, |(_, valid)| boxes.len() as u64 - u64::from(*valid));
        Ok(done.is_some())
    }

    /// Finds on a device what has changed, into `found`, if that is wanted; returns the boxes that began anew
    /// ([`GpuFinder::changes`]), nothing when it is not or could not be done.
    #[cfg(feature = "gpu")]
    pub(crate) fn changes_on_gpu(
        &mut self,
        request: &ChangeRequest<'_>,
        report: &mut Report,
    ) -> Result<Option<Vec<u32>>, Error> {
        stage!("gpu");
        let clock = Instant::now();
        let gpu = self.gpu.get_or_insert_with(GpuFinder::shared);
        let found = gpu.changes(request);
        Ok(self.settle(found, clock, report)?.map(|(restarted, _)| restarted))
    }

    /// Whether a search in which so many boxes have changed is to be tried on a device.
    pub(crate) fn wants_gpu(&self, config: &Config, changed: usize) -> Result<(), Option<NoGpu>> {
        match gpu_choice::choose(config.backend, self.device(), changed as u64) {
            Choice::Gpu => Ok(()),
            choice => Err(choice.no_gpu()),
        }
    }

    #[cfg(feature = "gpu")]
    fn device(&self) -> AvailableDevice {
        gpu::available(self.gpu.as_ref())
    }

    #[cfg(not(feature = "gpu"))]
    #[expect(clippy::unused_self, reason = "as with a GPU backend")]
    fn device(&self) -> AvailableDevice {
        AvailableDevice::NotBuilt
    }

    /// What a call to the device that began at `clock` comes to: nothing when it could not do the work.
    #[cfg(feature = "gpu")]
    fn settle(
        &mut self,
        found: Result<gpu::GpuFound, gpu::Failure>,
        mut clock: Instant,
        report: &mut Report,
    ) -> Result<Option<(Vec<u32>, u32)>, Error> {
        match found {
            Ok(found) => {
                self.warned = false;
                report.fallback = None;
                let time = lap(&mut clock);
                // The device's own times for its map; the rest of the call is check, transfer and decoding.
                let kernels = found.report.kernels.iter();
                let mapping = kernels.filter(|(name, _)| !name.starts_with("check")).map(|(_, time)| *time);
                let map = mapping.sum::<Duration>().min(time);
                report.stages.map += map;
                report.stages.check += time - map;
                let (chosen, swept) = match (&found.plan, found.valid) {
                    (None, 0 | 1) => (Chosen::Nothing, 0),
                    (None, valid) => (Chosen::Brute, valid),
                    (Some(_), _) => (Chosen::Pbig, 0),
                };
                let boxes = found.valid;
                report.plan = Plan { chosen, swept, boxes, gpu: found.plan, ..Plan::default() };
                (report.checks, report.gpu) = (found.checks, Some(found.report));
                self.found.clear();
                self.found.chunks = found.pairs;
                Ok(Some((found.restarted, found.valid)))
            }
            Err(gpu::Failure::Call(error)) => Err(error),
            Err(gpu::Failure::Device(error)) => {
                self.fall_back(format!("{error}: the CPU does the work"), report);
                Ok(None)
            }
        }
    }

    /// Says so when a backend is wanted that this build does not have; false, as no GPU does the work.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn miss_gpu(&mut self, config: &Config, report: &mut Report) -> bool {
        if config.backend == Backend::Gpu {
            let why = "no GPU backend in this build (feature `gpu`): the CPU does the work";
            self.fall_back(why.into(), report);
        }
        false
    }

    /// The wanted backend could not do the work: the report says so every time, a warning once.
    pub(crate) fn fall_back(&mut self, why: String, report: &mut Report) {
        if !self.warned {
            tracing::warn!("pbig: {why}");
            self.warned = true;
        }
        report.fallback = Some(why);
    }

    fn find_pbig<A>(
        &mut self,
        boxes: &[Aabb],
        config: &Config,
        accept: &A,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        self.found.clear();
        // Fewer than two valid boxes have no plan.
        let Plan { pbig: Some(plan), .. } = report.plan else { return Ok(()) };
        let mut clock = Instant::now();
        stage!("map and check");
        self.pbig.build(&plan, boxes);
        report.stages.map += lap(&mut clock);
        report.checks =
            self.pbig.find(&plan, config.gpu.small_cell, accept, config.limits.max_pairs, &mut self.found)?;
        report.stages.check += lap(&mut clock);
        Ok(())
    }
}

/// Checks of a structure that stores each box once: none is redundant.
pub(crate) fn single_entry_checks(found: &Found) -> Checks {
    Checks { made: found.checks, unnecessary: found.checks - found.overlaps, redundant: 0 }
}
