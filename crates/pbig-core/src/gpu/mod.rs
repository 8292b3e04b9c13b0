//! The GPU backend: PBIG's pipeline in WGSL, on any device that wgpu knows.
//!
//! ```text
//! upload ─► locate ─► visit ─► scan ─► schedule ─► scatter ─► arrange ─► check small, large ─► readback ─► decode
//! ```
//!
//! All of it is one submission and one wait, unless there is more work or output than fits in one
//! chunk. `session` is that call; `map` and `readback` record its ends; `engine` owns the device,
//! `storage` its buffers, `upload` what changed; `parts` splits sets that exceed the device's limits;
//! `changes` asks for the pairs that came or went instead of all.
//! The kernels are in the crate `pbig-shaders`, which buffers hold what in [`crate::layout`].
//!
//! Most callers set [`crate::Backend::Gpu`] and need nothing from here. An app that has a wgpu device
//! hands it over:
//!
//! ```no_run
//! # fn app(device: wgpu::Device, queue: wgpu::Queue) -> Result<(), Box<dyn std::error::Error>> {
//! use pbig_core::{Backend, Config, Finder, GpuFinder};
//! let gpu = GpuFinder::from_device(device, queue)?;
//! let mut finder = Finder::with_gpu(Config { backend: Backend::Gpu, ..Config::DEFAULT }, gpu);
//! # Ok(()) }
//! ```

mod adapter;
mod changes;
mod coding;
mod commands;
mod engine;
mod error;
mod flight;
mod map;
mod parts;
mod readback;
mod search;
mod session;
mod sink;
mod start;
mod storage;
pub mod study;
mod trial;
mod upload;

pub use adapter::{adapters, describe};
pub(crate) use changes::{Change, ChangeRequest};
#[doc(hidden)]
pub use engine::Fault;
pub(crate) use error::Failure;
pub use error::GpuError;
pub(crate) use trial::Trial;

use crate::cpu::found::Found;
use crate::plan::{NoGpu, Summary};
use crate::report::Report;
use crate::{Aabb, Backend, Config, GpuOptions, ProxyFilter};
use changes::Trail;
use engine::Engine;
use search::{Searched, Task, search};
use session::Session;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a call waits to see whether an app's device that was busy for too long is idle again.
const PROBE: Duration = Duration::from_millis(10);

/// Where a finder's device comes from, and where to look for another when it is lost.
#[derive(Clone, Debug)]
enum Source {
    /// The one that the process shares.
    Shared,
    /// One of its own, on the adapter of this name or on the best.
    Own(Option<String>),
    /// The caller's.
    Given,
}

/// A device for one [`crate::Finder`] or [`crate::BroadPhase`], with its buffers there.
#[derive(Debug)]
pub struct GpuFinder {
    source: Source,
    engine: Option<Arc<Engine>>,
    session: Option<(GpuOptions, Session)>,
    failed: Option<(Instant, String)>,
    crowding: f32,
    /// A software adapter passes for hardware, in tests.
    pretends: bool,
}

/// A copy shares the device and has buffers of its own.
impl Clone for GpuFinder {
    fn clone(&self) -> Self {
        Self { source: self.source.clone(), engine: self.engine.clone(), ..Self::shared() }
    }
}

/// What to find.
pub(crate) struct Request<'a> {
    pub(crate) boxes: &'a [Aabb],
    pub(crate) filters: Option<&'a [ProxyFilter]>,
    /// What the device does not know about a pair.
    pub(crate) accept: Option<&'a (dyn Fn(u32, u32) -> bool + Sync)>,
    pub(crate) summary: &'a Summary,
    pub(crate) config: &'a Config,
}

impl GpuFinder {
    /// A device of its own on the best adapter, or on that of `WGPU_ADAPTER_NAME`.
    ///
    /// # Errors
    /// When there is no adapter, or it gives no device that the kernels can run on.
    pub fn new() -> Result<Self, GpuError> {
        Self::open(None)
    }

    /// A device of its own on the first adapter whose name contains `name`, in any case.
    ///
    /// # Errors
    /// As [`GpuFinder::new`].
    pub fn on_adapter(name: &str) -> Result<Self, GpuError> {
        Self::open(Some(name.to_owned()))
    }

    /// A device of its own on a given adapter, see [`adapters`].
    ///
    /// # Errors
    /// When the adapter gives no device that the kernels can run on.
    pub fn on(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let engine = Some(Arc::new(Engine::on(adapter)?));
        Ok(Self { source: Source::Own(Some(adapter.get_info().name)), engine, ..Self::shared() })
    }

    /// On the app's own device, which is never replaced: when it is lost the calls run on the CPU.
    ///
    /// # Errors
    /// [`GpuError::TooLimited`] when the device allows less than WebGPU guarantees.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, GpuError> {
        let engine = Some(Arc::new(Engine::new(device, queue)?));
        Ok(Self { source: Source::Given, engine, ..Self::shared() })
    }

    fn open(name: Option<String>) -> Result<Self, GpuError> {
        let engine = Some(Arc::new(Engine::on(&adapter::choose(name.as_deref())?)?));
        Ok(Self { source: Source::Own(name), engine, ..Self::shared() })
    }

    /// The device that the process shares, opened at the first call.
    pub(crate) fn shared() -> Self {
        Self {
            source: Source::Shared,
            engine: None,
            session: None,
            failed: None,
            crowding: 1.0,
            pretends: false,
        }
    }

    /// The adapter's name, kind and API; empty before the first call of a shared device.
    pub fn adapter(&self) -> &str {
        self.engine.as_ref().map_or("", |engine| &engine.name)
    }

    /// The adapter, unless there is none yet or its device has failed.
    pub(crate) fn working_adapter(&self) -> Option<&str> {
        Some(self.adapter()).filter(|name| !name.is_empty() && self.failed.is_none())
    }

    /// Whether the adapter is a program, as lavapipe and WARP are: right, but slower than the CPU
    /// backend.
    pub fn is_software(&self) -> bool {
        self.engine.as_ref().is_some_and(|engine| engine.software)
    }

    /// In words, the variant of each stage that runs on the device, and why.
    pub fn variants(&self) -> Vec<String> {
        self.engine.as_ref().map_or(Vec::new(), |engine| engine.variants())
    }

    /// Makes [`crate::Backend::Auto`] take a software adapter for hardware.
    #[doc(hidden)]
    pub fn pretend_hardware(&mut self) {
        self.pretends = true;
    }

    /// Makes the device fail after so many more submissions.
    #[doc(hidden)]
    pub fn inject(&self, fault: Fault, submissions: u32) {
        if let Some(engine) = &self.engine {
            engine.inject(fault, submissions);
        }
    }

    /// All pairs of a request into `found`.
    pub(crate) fn find(
        &mut self,
        request: &Request<'_>,
        found: &mut Found,
        report: &mut Report,
    ) -> Result<(), Failure> {
        found.clear();
        self.check_pause(request.config)?;
        let result = self.try_find(request, found, report);
        if let Err(failure) = &result {
            self.fail(failure, found);
        }
        result
    }

    /// Nothing of a call that failed is relied upon later.
    fn fail(&mut self, failure: &Failure, found: &mut Found) {
        found.clear();
        match (failure, &mut self.session) {
            (Failure::Call(_), _) => self.forget_changes(),
            (Failure::Device(GpuError::Paused { .. }), _) => {}
            (Failure::Device(error), session) => {
                *session = None;
                self.failed = Some((Instant::now(), error.to_string()));
            }
        }
    }

    /// What the device was told last is not what an update has left: the next one begins with everything.
    pub(crate) fn forget_changes(&mut self) {
        if let Some((_, session)) = &mut self.session {
            session.mirror.forget_motions();
            session.trail = Trail::default();
        }
    }

    /// An error while calls stay on the CPU because the device failed a short while ago.
    fn check_pause(&self, config: &Config) -> Result<(), GpuError> {
        let pause = config.gpu.pause;
        match &self.failed {
            Some((when, why)) if when.elapsed() < pause => {
                Err(GpuError::Paused { ago: when.elapsed(), why: why.clone(), pause })
            }
            _ => Ok(()),
        }
    }

    /// The session, on a device that is not lost.
    fn session(&mut self, options: &GpuOptions) -> Result<&mut Session, GpuError> {
        if let Some(engine) = self.engine.take_if(|engine| engine.is_lost()) {
            self.session = None;
            // An app's device may only have been busy for too long.
            if matches!(self.source, Source::Given) && engine.is_idle_within(PROBE) {
                engine.take_back();
            }
            self.engine = Some(engine).filter(|_| matches!(self.source, Source::Given));
        }
        let engine = match (&self.engine, &self.source) {
            (Some(engine), _) if engine.is_lost() => return Err(GpuError::Lost),
            (Some(engine), _) => engine.clone(),
            (None, Source::Shared) => Engine::shared()?,
            (None, Source::Own(name)) => Arc::new(Engine::on(&adapter::choose(name.as_deref())?)?),
            (None, Source::Given) => return Err(GpuError::Lost),
        };
        self.engine = Some(engine.clone());
        let kept = self.session.take().filter(|(known, _)| known == options).map(|(_, session)| session);
        let session = match kept {
            Some(session) => session,
            None => engine.clone().watch(|| Session::new(engine, options))?,
        };
        Ok(&mut self.session.insert((*options, session)).1)
    }

    fn try_find(
        &mut self,
        request: &Request<'_>,
        found: &mut Found,
        report: &mut Report,
    ) -> Result<(), Failure> {
        let crowding = self.crowding;
        let session = self.session(&request.config.gpu)?;
        let engine = session.engine.clone();
        let searched = engine.watch(|| search(session, &Task::new(request), crowding, found))?;
        session.end_call();
        let useful = request.boxes.len() as u64 + searched.pairs;
        self.finish(searched, useful, report);
        Ok(())
    }

    /// A search has succeeded; boxes and pairs were worth `useful` tests.
    fn finish(&mut self, searched: Searched, useful: u64, report: &mut Report) {
        self.failed = None;
        if searched.plan.gpu.is_some() {
            self.learn(&searched, useful.max(1));
        }
        report.checks = searched.checks;
        report.plan = searched.plan;
        report.gpu = Some(searched.gpu);
    }

    /// Finer cells next time if these were far too full, coarser ones if they were nearly empty.
    fn learn(&mut self, searched: &Searched, useful: u64) {
        let waste = searched.checks.made / useful;
        if waste > 64 {
            self.crowding = (self.crowding * 0.5).max(1.0 / 64.0);
        } else if waste < 4 {
            self.crowding = (self.crowding * 2.0).min(1.0);
        }
    }
}

/// Whether a search should run on a device; if not, and where that was left open, why. `few_changed`: most boxes are where
/// the CPU knows them.
pub(crate) fn wanted(
    config: &Config,
    gpu: Option<&GpuFinder>,
    trial: &mut Trial,
    boxes: usize,
    few_changed: bool,
) -> Result<(), Option<NoGpu>> {
    match (config.backend, gpu) {
        (Backend::Gpu, _) => Ok(()),
        (Backend::Cpu | Backend::Brute, _) => Err(None),
        (Backend::Auto, None) => Err(Some(NoGpu::NotGiven)),
        (Backend::Auto, Some(gpu)) if gpu.is_software() && !gpu.pretends => Err(Some(NoGpu::Software)),
        (Backend::Auto, Some(_)) if few_changed => Err(Some(NoGpu::FewChanged)),
        (Backend::Auto, Some(_)) => trial.wants_gpu(boxes).map_err(Some),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_is_not_asked_is_not_for_a_reason() {
        let (mut trial, gpu) = (Trial::default(), GpuFinder::shared());
        let mut why = |backend, gpu, boxes, few_changed| {
            let config = Config { backend, ..Config::DEFAULT };
            wanted(&config, gpu, &mut trial, boxes, few_changed)
        };
        assert_eq!(why(Backend::Gpu, None, 2, true), Ok(()));
        assert_eq!(why(Backend::Cpu, Some(&gpu), 1 << 20, false), Err(None));
        assert_eq!(why(Backend::Auto, None, 1 << 20, false), Err(Some(NoGpu::NotGiven)));
        assert_eq!(why(Backend::Auto, Some(&gpu), 100, false), Err(Some(NoGpu::FewBoxes)));
        assert_eq!(why(Backend::Auto, Some(&gpu), 1 << 20, true), Err(Some(NoGpu::FewChanged)));
        assert_eq!(why(Backend::Auto, Some(&gpu), 1 << 20, false), Err(Some(NoGpu::Unmeasured)));
    }
}
