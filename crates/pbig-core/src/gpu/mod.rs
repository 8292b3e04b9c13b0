//! The GPU backend: PBIG's pipeline in WGSL, on any device that wgpu supports.
//!
//! ```text
//! upload ─► locate ─► visit ─► scan ─► schedule ─► scatter ─► check ─► count, place and rank pairs ─► readback
//! ```
//!
//! A call is one submission and one wait, unless there is more work or output than fits in one chunk, or no plan yet.
//!
//! `docs/GPU.md` says why it is right and which file has what.
//! The kernels are in the crate `pbig-shaders`. The module `layout` has the structs that their buffers hold.
//!
//! Most callers set [`crate::Backend::Gpu`] and need nothing from here. An app that has a wgpu device passes it on:
//!
//! ```no_run
//! # fn app(device: wgpu::Device, queue: wgpu::Queue) -> Result<(), Box<dyn std::error::Error>> {
//! use pbig_core::{Backend, Config, Finder, GpuFinder};
//! let gpu = GpuFinder::from_device(device, queue)?;
//! let mut finder = Finder::with_gpu(Config { backend: Backend::Gpu, ..Config::DEFAULT }, gpu);
//! # Ok(()) }
//! ```

#![cfg_attr(not(feature = "unstable-study"), allow(unreachable_pub, reason = "`study` shows parts of it"))]

mod adapter;
mod attempts;
mod changes;
mod chunk;
mod coding;
mod device;
mod error;
mod items;
mod job;
mod kept_plan;
mod levels;
mod passes;
mod plan;
mod readback;
mod search;
mod session;
mod sink;
mod storage;
#[cfg(feature = "unstable-study")]
pub mod study;
mod upload;

pub use adapter::{adapters, describe};
pub(crate) use changes::{Change, ChangeRequest};
pub(crate) use error::Failure;
pub use error::GpuError;
pub use plan::GpuPlan;
pub(crate) use sink::GpuFound;

use crate::policy::AvailableDevice;
use crate::{Config, GpuOptions, Pair};
use device::GpuDevice;
pub(crate) use search::SearchRequest;
use search::search;
use session::Session;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time that a call waits for a device of the app that was busy for too long.
const PROBE: Duration = Duration::from_millis(10);

/// The origin of a finder's device. It tells where to look for another one when the device is lost.
#[derive(Clone, Debug)]
enum Source {
    /// The device that the process shares.
    Shared,
    /// A device of its own, on the adapter of this name or on the best.
    Own(Option<String>),
    /// The caller's device.
    Given,
}

/// A device for one [`crate::Finder`] or [`crate::BroadPhase`], with its buffers there.
#[derive(Debug)]
pub struct GpuFinder {
    source: Source,
    device: Option<Arc<GpuDevice>>,
    session: Option<Session>,
    failed: Option<(Instant, String)>,
    /// [`crate::Backend::Auto`] takes a software adapter for hardware, in tests.
    pretends_hardware: bool,
}

/// A copy shares the device and has buffers of its own.
impl Clone for GpuFinder {
    fn clone(&self) -> Self {
        Self { source: self.source.clone(), device: self.device.clone(), ..Self::shared() }
    }
}

impl GpuFinder {
    /// Opens a device on the best adapter, or on the one that `WGPU_ADAPTER_NAME` names.
    ///
    /// # Errors
    /// If there is no adapter, or if it gives no device that the kernels can run on.
    pub fn new() -> Result<Self, GpuError> {
        Self::open(None)
    }

    /// Opens a device on the first adapter whose name contains `name`, in any case.
    ///
    /// # Errors
    /// As [`GpuFinder::new`].
    pub fn on_adapter(name: &str) -> Result<Self, GpuError> {
        Self::open(Some(name.to_owned()))
    }

    /// Opens a device on the given adapter, see [`adapters`].
    ///
    /// # Errors
    /// If the adapter gives no device that the kernels can run on.
    pub fn on(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        Ok(Self::with(Source::Own(Some(adapter.get_info().name)), GpuDevice::on(adapter)?))
    }

    /// Uses the app's own device, which is never replaced: after its loss, calls run on the CPU.
    ///
    /// # Errors
    /// [`GpuError::TooLimited`] if the device allows less than WebGPU guarantees.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, GpuError> {
        Ok(Self::with(Source::Given, GpuDevice::new(device, queue)?))
    }

    fn open(name: Option<String>) -> Result<Self, GpuError> {
        let device = GpuDevice::on(&adapter::choose(name.as_deref())?)?;
        Ok(Self::with(Source::Own(name), device))
    }

    fn with(source: Source, device: GpuDevice) -> Self {
        Self { source, device: Some(Arc::new(device)), ..Self::shared() }
    }

    /// Returns a finder on the device that the process shares. The first call opens it.
    pub(crate) fn shared() -> Self {
        Self { source: Source::Shared, device: None, session: None, failed: None, pretends_hardware: false }
    }

    /// Returns the adapter's name, kind and API; empty before the first call on a shared device.
    pub fn adapter(&self) -> &str {
        self.device.as_ref().map_or("", |device| &device.name)
    }

    /// Returns the adapter, unless no device is open yet or the device has failed.
    pub(crate) fn working_adapter(&self) -> Option<&str> {
        Some(self.adapter()).filter(|name| !name.is_empty() && self.failed.is_none())
    }

    /// Returns true if the adapter is a program, as lavapipe and WARP are: right, but slower than the CPU backend.
    pub fn is_software(&self) -> bool {
        self.device.as_ref().is_some_and(|device| device.is_software)
    }

    /// Finds all pairs. The result uses the memory of `pairs`.
    pub(crate) fn find(
        &mut self,
        request: &SearchRequest<'_>,
        pairs: Vec<Pair>,
    ) -> Result<GpuFound, Failure> {
        self.run(request.config, 0, |session| search(session, request, pairs))
    }

    /// Runs a search, of a set with so many kept pairs, and notes how it went.
    fn run(
        &mut self,
        config: &Config,
        kept: u64,
        search: impl FnOnce(&mut Session) -> Result<GpuFound, Failure>,
    ) -> Result<GpuFound, Failure> {
        let result = self.try_run(config, search);
        match (&result, &mut self.session) {
            (Err(failure), _) => self.fail(failure),
            (Ok(found), session) => {
                self.failed = None;
                session.iter_mut().for_each(|session| session.end_call(found, kept));
            }
        }
        result
    }

    fn try_run(
        &mut self,
        config: &Config,
        search: impl FnOnce(&mut Session) -> Result<GpuFound, Failure>,
    ) -> Result<GpuFound, Failure> {
        self.check_pause(config)?;
        let session = self.session(&config.gpu)?;
        session.device.clone().watch(|| search(session))
    }

    /// Drops all state that a failed call may have left wrong.
    fn fail(&mut self, failure: &Failure) {
        match (failure, &mut self.session) {
            (Failure::Call(_), _) => self.forget_changes(),
            (Failure::Device(GpuError::Paused { .. }), _) => {}
            (Failure::Device(error), session) => {
                *session = None;
                self.failed = Some((Instant::now(), error.to_string()));
            }
        }
    }

    /// Makes the next search for changes upload all boxes.
    ///
    /// To be called after an update that failed although the device had found its changes: the device has gone on to
    /// the new boxes, the caller has not.
    pub(crate) fn forget_changes(&mut self) {
        if let Some(session) = &mut self.session {
            session.uploaded.forget_motions();
        }
    }

    /// Returns an error while calls stay on the CPU because the device failed a short while ago.
    fn check_pause(&self, config: &Config) -> Result<(), GpuError> {
        let pause = config.gpu.pause;
        match &self.failed {
            Some((when, why)) if when.elapsed() < pause => {
                Err(GpuError::Paused { ago: when.elapsed(), why: why.clone(), pause })
            }
            _ => Ok(()),
        }
    }

    fn session(&mut self, options: &GpuOptions) -> Result<&mut Session, GpuError> {
        if let Some(device) = self.device.take_if(|device| device.is_lost()) {
            self.session = None;
            // An app's device may only have been busy for too long.
            if matches!(self.source, Source::Given) && device.is_idle_within(PROBE) {
                device.take_back();
            }
            self.device = Some(device).filter(|_| matches!(self.source, Source::Given));
        }
        let device = match (&self.device, &self.source) {
            (Some(device), _) if device.is_lost() => return Err(GpuError::Lost),
            (Some(device), _) => device.clone(),
            (None, Source::Shared) => GpuDevice::shared()?,
            (None, Source::Own(name)) => Arc::new(GpuDevice::on(&adapter::choose(name.as_deref())?)?),
            (None, Source::Given) => return Err(GpuError::Lost),
        };
        self.device = Some(device.clone());
        let session = match self.session.take().filter(|session| session.options == *options) {
            Some(session) => session,
            None => device.clone().watch(|| Session::new(device, options))?,
        };
        Ok(self.session.insert(session))
    }
}

/// Returns the device at hand, for [`crate::policy::choose_backend`].
pub(crate) fn available(gpu: Option<&GpuFinder>) -> AvailableDevice {
    match gpu {
        None => AvailableDevice::NotGiven,
        Some(gpu) if gpu.is_software() && !gpu.pretends_hardware => AvailableDevice::Software,
        Some(_) => AvailableDevice::Hardware,
    }
}
