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
pub mod testing;
mod upload;

pub use adapter::{adapters, describe};
use error::Failure;
pub use error::GpuError;
pub use plan::GpuPlan;

use crate::GpuOptions;
use device::GpuDevice;
use pbig_core::{ChangeRequest, DeviceFailure, DeviceFound, Pair, PairDevice, SearchRequest};
use search::{Search, search};
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

/// A device for one [`pbig_core::Finder`] or [`pbig_core::BroadPhase`], with its buffers there.
#[derive(Debug)]
pub struct GpuFinder {
    source: Source,
    options: GpuOptions,
    device: Option<Arc<GpuDevice>>,
    session: Option<Session>,
    failed: Option<(Instant, String)>,
    /// [`pbig_core::Backend::Auto`] takes a software adapter for hardware, in tests.
    pretends_hardware: bool,
}

/// A copy shares the device and has buffers of its own.
impl Clone for GpuFinder {
    fn clone(&self) -> Self {
        let Self { source, options, device, .. } = self;
        Self { source: source.clone(), options: *options, device: device.clone(), ..Self::shared() }
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
    pub fn shared() -> Self {
        Self {
            source: Source::Shared,
            options: GpuOptions::DEFAULT,
            device: None,
            session: None,
            failed: None,
            pretends_hardware: false,
        }
    }

    /// Returns the finder with other settings.
    pub fn with_options(self, options: GpuOptions) -> Self {
        Self { options, ..self }
    }

    /// Returns the adapter's name, kind and API; empty before the first call on a shared device.
    pub fn adapter(&self) -> &str {
        self.device.as_ref().map_or("", |device| &device.name)
    }

    /// Returns true if the adapter is a program, as lavapipe and WARP are: right, but slower than the CPU backend.
    pub fn is_software(&self) -> bool {
        self.device.as_ref().is_some_and(|device| device.is_software)
    }

    /// Runs a search, and notes how it went.
    fn run(&mut self, request: &Search<'_>, found: &mut DeviceFound) -> Result<(), DeviceFailure> {
        let result = self.try_run(request, std::mem::take(&mut found.pairs));
        if let Err(failure) = &result {
            self.fail(failure);
        }
        *found = result.map_err(Failure::for_core)?;
        self.failed = None;
        self.session.iter_mut().for_each(|session| session.end_call(found, request.kept()));
        Ok(())
    }

    fn try_run(&mut self, request: &Search<'_>, pairs: Vec<Pair>) -> Result<DeviceFound, Failure> {
        self.check_pause()?;
        let session = self.session()?;
        session.device.clone().watch(|| search(session, request, pairs))
    }

    /// Drops all state that a failed call may have left wrong.
    fn fail(&mut self, failure: &Failure) {
        match (failure, &mut self.session) {
            (Failure::TooManyPairs, _) => self.forget(),
            (Failure::Device(GpuError::Paused { .. }), _) => {}
            (Failure::Device(error), session) => {
                *session = None;
                self.failed = Some((Instant::now(), error.to_string()));
            }
        }
    }

    /// Returns an error while calls stay on the CPU because the device failed a short while ago.
    fn check_pause(&self) -> Result<(), GpuError> {
        let pause = self.options.pause;
        match &self.failed {
            Some((when, why)) if when.elapsed() < pause => {
                Err(GpuError::Paused { ago: when.elapsed(), why: why.clone(), pause })
            }
            _ => Ok(()),
        }
    }

    fn session(&mut self) -> Result<&mut Session, GpuError> {
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
        let session = match self.session.take().filter(|session| session.options == self.options) {
            Some(session) => session,
            None => device.clone().watch(|| Session::new(device, &self.options))?,
        };
        Ok(self.session.insert(session))
    }
}

impl PairDevice for GpuFinder {
    fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        self.run(&Search::all(request), found)
    }

    /// The device has each box now and at the last update (`shaders/shared/search_changes.wgsl`). So transfers in both
    /// directions are proportional to the number of changes.
    fn find_changed(
        &mut self,
        request: &ChangeRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        self.run(&Search::changes(request), found)
    }

    fn forget(&mut self) {
        if let Some(session) = &mut self.session {
            session.uploaded.forget_motions();
        }
    }

    fn name(&self) -> Option<&str> {
        Some(self.adapter()).filter(|name| !name.is_empty() && self.failed.is_none())
    }

    fn is_software(&self) -> bool {
        self.is_software() && !self.pretends_hardware
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}
