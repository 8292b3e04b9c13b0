//! The GPU backend: PBIG's pipeline in WGSL, on any device that wgpu knows.
//!
//! ```text
//! upload ─► locate ─► visit ─► scan ─► schedule ─► scatter ─► check small, large ─► readback ─► decode
//! ```
//!
//! All of it is one submission and one wait, unless there is more work or output than fits in one
//! chunk. `session` is that call; `map` and `readback` record its ends; `engine` owns the device,
//! `storage` its buffers, `upload` what changed; `parts` splits sets that exceed the device's limits.
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
mod coding;
mod commands;
mod engine;
mod error;
mod flight;
mod map;
mod parts;
mod readback;
mod session;
mod sink;
mod storage;
pub mod study;
mod trial;
mod upload;

pub use adapter::adapters;
#[doc(hidden)]
pub use engine::Fault;
pub(crate) use error::Failure;
pub use error::GpuError;
pub(crate) use trial::Trial;

use crate::cpu::find::Found;
use crate::layout::{BOX_BITS, Located};
use crate::plan::{Chosen, GpuPlan, Plan, Summary};
use crate::report::{Checks, GpuReport, Report};
use crate::{Aabb, Backend, Config, GpuOptions, ProxyFilter, Strategy};
use engine::Engine;
use session::{Job, Session};
use sink::Sink;
use std::sync::Arc;
use std::time::Instant;

/// Boxes up to which every pair is tested, without a grid. Avril's table 7 puts the crossover at 1000.
const SMALL_SCENE: usize = 1024;

/// Boxes of one cell whose work items, 2^17 rows against 2^17 / 8 times 8 columns, 32 bits can count.
const MOST_IN_A_CELL: u64 = 1 << 25;

/// Fewest boxes that are split further for want of room.
const SMALLEST_PART: usize = 256;

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
        if let Err(Failure::Device(error)) = &result {
            found.clear();
            self.session = None;
            self.failed = Some((Instant::now(), error.to_string()));
        }
        result
    }

    /// Whether calls stay on the CPU because the device failed a short while ago.
    pub(crate) fn is_paused(&self, config: &Config) -> bool {
        self.check_pause(config).is_err()
    }

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
            if matches!(self.source, Source::Given) && engine.is_alive() {
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
        let searched = engine.watch(|| search(session, request, crowding, found))?;
        session.end_call();
        self.failed = None;
        if searched.plan.gpu.is_some() {
            self.learn(&searched, request.boxes.len());
        }
        report.checks = searched.checks;
        report.plan = searched.plan;
        report.gpu = Some(searched.gpu);
        Ok(())
    }

    /// Finer cells next time if these were far too full, coarser ones if they were nearly empty.
    fn learn(&mut self, searched: &Searched, boxes: usize) {
        let useful = (searched.pairs + boxes as u64).max(1);
        let waste = searched.checks.made / useful;
        if waste > 64 {
            self.crowding = (self.crowding * 0.5).max(1.0 / 64.0);
        } else if waste < 4 {
            self.crowding = (self.crowding * 2.0).min(1.0);
        }
    }
}

/// What a search came to.
struct Searched {
    checks: Checks,
    plan: Plan,
    gpu: GpuReport,
    pairs: u64,
}

/// Searches in as few parts as fit.
fn search(
    session: &mut Session,
    request: &Request<'_>,
    crowding: f32,
    found: &mut Found,
) -> Result<Searched, Failure> {
    let mut most = most_boxes(session);
    loop {
        found.clear();
        let gpu = GpuReport {
            adapter: session.engine.name.clone(),
            subgroups: session.engine.subgroups,
            ..GpuReport::default()
        };
        let mut sink = Sink {
            found,
            used: 0,
            pairs: 0,
            written: 0,
            limit: request.config.limits.max_pairs,
            ids: None,
            accept: request.accept,
            checks: Checks::default(),
            report: gpu,
        };
        let result = if request.boxes.len() <= most {
            search_whole(session, request, crowding, &mut sink)
        } else {
            search_parts(session, request, crowding, most, &mut sink)
        };
        match result {
            // A list that only the device knows the length of was too long: fewer boxes make it shorter.
            Err(Failure::Device(GpuError::TooLarge { .. })) if most > SMALLEST_PART => {
                most = (most.min(request.boxes.len()) / 2).max(SMALLEST_PART);
                session.part_limit = most;
            }
            Err(failure) => return Err(failure),
            Ok(plan) => {
                let words = sink.report.compression;
                let pairs = sink.written;
                sink.report.compression = if pairs > 0 { words / (2 * pairs) as f64 } else { 0.0 };
                return Ok(Searched { checks: sink.checks, plan, gpu: sink.report, pairs });
            }
        }
    }
}

/// How many boxes fit: each has a place in every buffer, and a number in an entry.
fn most_boxes(session: &Session) -> usize {
    let by_bytes = session.storage.most_bytes() / size_of::<Located>() as u64;
    (by_bytes.min(1 << BOX_BITS).min(MOST_IN_A_CELL) as usize).min(session.part_limit)
}

/// Entries are counted in 32 bits: at most 4 x 4 x 4 for a box in each level but the last.
fn check_entries(plan: &GpuPlan, boxes: usize) -> Result<(), GpuError> {
    let entries = boxes as u64 * (64 * (plan.levels.len() as u64 - 1) + 1);
    let limit = u64::from(u32::MAX);
    if entries <= limit { Ok(()) } else { Err(GpuError::TooLarge { what: "entries", bytes: entries, limit }) }
}

fn search_whole(
    session: &mut Session,
    request: &Request<'_>,
    crowding: f32,
    sink: &mut Sink<'_>,
) -> Result<Plan, Failure> {
    sink.report.parts = 1;
    let valid = request.summary.valid;
    if valid < 2 {
        return Ok(Plan { boxes: valid, ..Plan::default() });
    }
    let config = request.config;
    let brute = config.strategy == Strategy::Auto && request.boxes.len() <= SMALL_SCENE;
    let plan = (!brute).then(|| plan(session, request.summary, config, crowding));
    plan.as_ref().map_or(Ok(()), |plan| check_entries(plan, request.boxes.len()))?;
    let job = Job { boxes: request.boxes, filters: request.filters, split: 0, plan: plan.as_ref(), config };
    session.run(&job, sink)?;
    let (chosen, swept) = if brute { (Chosen::Brute, valid) } else { (Chosen::Pbig, 0) };
    Ok(Plan { chosen, swept, boxes: valid, gpu: plan, ..Plan::default() })
}

fn plan(session: &Session, summary: &Summary, config: &Config, crowding: f32) -> GpuPlan {
    let most_cells = (session.storage.most_bytes() / 8).min(1 << 28) as u32;
    GpuPlan::new(summary, config, crowding, most_cells)
}

fn search_parts(
    session: &mut Session,
    request: &Request<'_>,
    crowding: f32,
    most: usize,
    sink: &mut Sink<'_>,
) -> Result<Plan, Failure> {
    let (sorted, axis) = parts::sorted(request.boxes, request.summary);
    let parts = parts::parts(request.boxes, &sorted, axis, most / 2);
    let mut last = None;
    for part in &parts {
        let ids: Vec<u32> = [part.first, part.second].concat();
        let boxes: Vec<Aabb> = ids.iter().map(|&id| request.boxes[id as usize]).collect();
        let filters: Option<Vec<ProxyFilter>> =
            request.filters.map(|all| ids.iter().map(|&id| all[id as usize]).collect());
        let split = if part.second.is_empty() { 0 } else { part.first.len() as u32 };
        let plan = plan(session, &Summary::of(&boxes, None), request.config, crowding);
        check_entries(&plan, boxes.len())?;
        let config = request.config;
        let job = Job { boxes: &boxes, filters: filters.as_deref(), split, plan: Some(&plan), config };
        let mut own = Sink { ids: Some(&ids), found: &mut *sink.found, report: sink.report.clone(), ..*sink };
        session.run(&job, &mut own)?;
        (sink.used, sink.pairs, sink.written) = (own.used, own.pairs, own.written);
        (sink.checks, sink.report) = (own.checks, own.report);
        last = Some(plan);
    }
    sink.report.parts = parts.len() as u32;
    let valid = request.summary.valid;
    Ok(Plan { chosen: Chosen::Pbig, boxes: valid, gpu: last, ..Plan::default() })
}

/// Whether a search should run on a device.
pub(crate) fn wanted(config: &Config, gpu: Option<&GpuFinder>, trial: &mut Trial, boxes: usize) -> bool {
    match config.backend {
        Backend::Gpu => true,
        Backend::Auto => gpu.is_some_and(|gpu| gpu.pretends || !gpu.is_software()) && trial.wants_gpu(boxes),
        Backend::Cpu | Backend::Brute => false,
    }
}
