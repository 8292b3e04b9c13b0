//! The GPU backend: PBIG's pipeline in WGSL, on any device that wgpu supports. `shaders/README.md` shows it, and says why it is right.
//!
//! The kernels are in the crate `pbig-shaders`. The module `layout` has the structs that their buffers hold.

mod adapter;
mod declined;
mod error;
mod forecast;
mod gpu_device;
mod gpu_plan;
mod levels;
mod passes;
mod reports;
mod resident;
mod search;
mod session;
mod storage;
pub mod testing;
mod ticks;
mod timer;
#[cfg_attr(target_arch = "wasm32", path = "wait_web.rs")]
mod wait;
mod watch;

pub use adapter::describe;
pub use error::{DECLINED, GpuError};
use gpu_plan::GpuPlan;
pub use resident::{DeviceBoxes, DevicePairs};

use crate::GpuOptions;
use declined::Declined;
use error::Result;
use gpu_device::GpuDevice;
use pbig_core::internal::Clock;
use pbig_core::{DeviceFailure, DeviceFound, PairDevice, SearchRequest};
use pbig_shaders::{KERNELS, SCAN_OF_ROWS};
use resident::Resident;
use session::Session;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Returns all adapters, best first: discrete, integrated, virtual, unknown, software.
///
/// None in a browser, where nothing may block. `WGPU_BACKEND` and wgpu's other variables apply. With `WGPU_POWER_PREF=low` integrated adapters come first.
pub fn adapters() -> Vec<wgpu::Adapter> {
    wait::block_on(async { Ok::<_, GpuError>(adapter::best_first().await) }).unwrap_or_default()
}

/// Returns the adapter whose name contains `name`, in any case, or whose place among [`adapters`] is `name`, such as `1` or `gpu 1`;
/// without a name the one that [`GpuFinder::new`] uses.
///
/// # Errors
/// As [`GpuFinder::new`], if there is no such adapter.
pub fn adapter(name: Option<&str>) -> Result<wgpu::Adapter, GpuError> {
    wait::block_on(adapter::choose(name))
}

/// Time that a call waits for a device of the app that was busy for too long.
const PROBE: Duration = Duration::from_millis(10);

/// The origin of a finder's device. It tells where to look for another one when the device is lost.
#[derive(Clone, Debug, Default)]
enum Source {
    /// The device that the process shares.
    #[default]
    Shared,
    /// A device of its own, on the adapter of this name or on the best.
    Own(Option<String>),
    /// The caller's device.
    Given,
}

/// A device for one [`pbig_core::Finder`] or [`pbig_core::BroadPhase`], with its buffers there.
#[derive(Debug, Default)]
pub struct GpuFinder {
    source: Source,
    options: GpuOptions,
    device: Option<Arc<GpuDevice>>,
    session: Option<Session>,
    resident: Option<Resident>,
    failed: Option<(Clock, String)>,
    declined: Declined,
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
        wait::block_on(Self::open_async())
    }

    /// Opens a device as [`GpuFinder::new`], without blocking. In a browser this is the way, with [`GpuFinder::find_all_async`].
    ///
    /// # Errors
    /// As [`GpuFinder::new`].
    pub async fn open_async() -> Result<Self, GpuError> {
        Ok(Self::with(Source::Own(None), GpuDevice::on(&adapter::choose(None).await?).await?))
    }

    /// Opens a device on the given adapter, see [`adapters`].
    ///
    /// # Errors
    /// If the adapter gives no device that the kernels can run on.
    pub fn on(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let device = wait::block_on(GpuDevice::on(adapter))?;
        Ok(Self::with(Source::Own(Some(adapter.get_info().name)), device))
    }

    /// Uses the app's own device, which is never replaced: after its loss, calls run on the CPU.
    ///
    /// # Errors
    /// [`GpuError::TooLimited`] if the device allows less than WebGPU guarantees.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, GpuError> {
        Ok(Self::with(Source::Given, GpuDevice::new(device, queue)?))
    }

    fn with(source: Source, device: GpuDevice) -> Self {
        Self { source, device: Some(Arc::new(device)), ..Self::shared() }
    }

    /// Returns a finder on the device that the process shares. The first call opens it.
    pub fn shared() -> Self {
        Self::default()
    }

    /// Returns the finder with other settings.
    pub fn with_options(self, options: GpuOptions) -> Self {
        Self { options, ..self }
    }

    /// Compiles all kernels for the present options. Otherwise the first call does, which takes a driver up to a second: call it while the app loads, perhaps on a clone in another thread.
    ///
    /// # Errors
    /// As [`GpuFinder::new`], and [`GpuError::Refused`].
    pub fn prepare(&mut self) -> Result<(), GpuError> {
        wait::block_on(self.prepare_async())
    }

    /// Compiles all kernels as [`GpuFinder::prepare`], without blocking.
    ///
    /// # Errors
    /// As [`GpuFinder::prepare`].
    pub async fn prepare_async(&mut self) -> Result<(), GpuError> {
        let (device, is_balanced) = (self.open_device().await?, self.options.load_balancing);
        let compile = async || {
            KERNELS.iter().chain(SCAN_OF_ROWS).for_each(|kernel| drop(device.pipeline(kernel, is_balanced)));
            Ok(())
        };
        device.watch(compile).await
    }

    /// Returns the adapter's name, kind and API; empty before the first call on a shared device.
    pub fn adapter(&self) -> &str {
        self.device.as_ref().map_or("", |device| &device.name)
    }

    /// Returns true if the adapter is a program, as lavapipe and WARP are: right, but slower than the CPU backend.
    pub fn is_software(&self) -> bool {
        self.device.as_ref().is_some_and(|device| device.is_software)
    }

    /// Finds all pairs without blocking, as [`PairDevice::find_all`]. A program blocks all the same while the device works, and a page
    /// does not. In a page one call at a time may use a device; a call that is given up, by dropping its future, costs no later
    /// one its pairs.
    ///
    /// ```
    /// # use pbig_core::{Aabb, DeviceFailure, DeviceFound, SearchRequest};
    /// # use pbig_gpu::GpuFinder;
    /// async fn count(boxes: &[Aabb], finder: &mut GpuFinder) -> Result<usize, DeviceFailure> {
    ///     let request = SearchRequest { boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
    ///     let mut found = DeviceFound::default();
    ///     finder.find_all_async(&request, &mut found).await?;
    ///     Ok(found.pairs.len())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`DeviceFailure`]. Then `found` may hold anything.
    pub async fn find_all_async(
        &mut self,
        request: &SearchRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        self.run(request, found).await.map_err(GpuError::for_core)
    }

    /// Records a search of boxes that live on the device, and whose pairs stay there. Submits nothing, waits for nothing, and, where
    /// lengths stay, allocates nothing.
    ///
    /// Plan and lengths follow from the counts of earlier calls. The first call of more than [`GpuOptions::all_pairs_up_to`] boxes only
    /// measures them, and a call with many more pairs than the last one may not have room for them. Then the result says so, and the
    /// call can be repeated: see [`crate::PairCount`]. A list beyond what one buffer holds is an error of a later call. Each scene
    /// has a finder of its own, which may be a clone: plan and lengths are those of one scene.
    ///
    /// The caller submits what was recorded in the order of the calls, and polls the device from time to time, as wgpu asks; a call polls
    /// it once. `examples/resident.rs` shows all.
    ///
    /// # Errors
    /// [`GpuError::Argument`] if the boxes do not lie in a buffer from which the device can copy them; [`GpuError::Refused`] if that buffer
    /// is that of another device of the same [`wgpu::Instance`]; other errors as those of a search. An encoder of another device is
    /// wgpu's error when it is finished.
    pub fn record_pairs(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        boxes: &DeviceBoxes<'_>,
    ) -> Result<DevicePairs, GpuError> {
        let device = self.device_now()?;
        let mut kept = self.resident.take().filter(|kept| kept.storage.suits(&device, &self.options));
        let resident = kept.get_or_insert_with(|| Resident::new(&device, &self.options));
        let result = device.watch_now(|| resident.record(encoder, boxes));
        self.resident = kept.filter(|_| is_sound(&result));
        result
    }

    /// Records a search as [`GpuFinder::record_pairs`], and submits it.
    ///
    /// # Errors
    /// As [`GpuFinder::record_pairs`].
    pub fn submit_pairs(
        &mut self,
        boxes: &DeviceBoxes<'_>,
    ) -> Result<(DevicePairs, wgpu::SubmissionIndex), GpuError> {
        let device = self.device_now()?;
        let mut encoder = device.encoder();
        let pairs = self.record_pairs(&mut encoder, boxes)?;
        let submission = device.watch_now(|| Ok(device.submit(encoder)))?;
        Ok((pairs, submission))
    }

    /// Returns the device, which a page has opened before.
    fn device_now(&mut self) -> Result<Arc<GpuDevice>> {
        match &self.device {
            Some(device) if !device.is_lost() => Ok(device.clone()),
            _ => wait::block_on(self.open_device()),
        }
    }

    async fn run(&mut self, request: &SearchRequest<'_>, found: &mut DeviceFound) -> Result<()> {
        self.check_pause()?;
        let boxes = request.boxes.len();
        if let Some(why) = self.declined.unseen(boxes) {
            return Err(GpuError::Declined(why));
        }
        let result = self.try_run(request, found).await;
        self.failed = None;
        match &result {
            Ok(()) => self.declined = Declined::default(),
            Err(GpuError::Declined(why)) => self.declined.note(boxes, why),
            Err(error) if error.is_failure() => self.failed = Some((Clock::start(), error.to_string())),
            Err(_) => {}
        }
        result
    }

    /// Runs a search in a session that is kept unless the device failed.
    async fn try_run(&mut self, request: &SearchRequest<'_>, found: &mut DeviceFound) -> Result<()> {
        let device = self.open_device().await?;
        let mut kept = self.session.take().filter(|kept| kept.storage.suits(&device, &self.options));
        let search = async || {
            let session = kept.get_or_insert_with(|| Session::new(&device, &self.options));
            session.search(request, std::mem::take(&mut found.pairs)).await
        };
        let result = device.watch(search).await;
        self.session = kept.filter(|_| is_sound(&result));
        *found = result?;
        Ok(())
    }

    /// Returns an error while calls stay on the CPU because the device failed a short while ago.
    fn check_pause(&self) -> Result<()> {
        let pause = self.options.pause;
        let Some((clock, why)) = &self.failed else { return Ok(()) };
        match clock.time() {
            Some(ago) if ago < pause => {
                Err(GpuError::Paused(format!("{ago:?} ago ({why}); it is tried again after {pause:?}")))
            }
            _ => Ok(()),
        }
    }

    /// Returns the device, or another one if it was lost.
    async fn open_device(&mut self) -> Result<Arc<GpuDevice>> {
        if let Some(device) = self.device.as_ref().filter(|device| !device.is_lost()) {
            return Ok(device.clone());
        }
        let device = match (&self.source, &self.device) {
            (Source::Shared, _) => GpuDevice::shared().await?,
            (Source::Own(name), _) => {
                Arc::new(GpuDevice::on(&adapter::choose(name.as_deref()).await?).await?)
            }
            // It may only have been busy for too long.
            (Source::Given, Some(device)) if device.is_idle_within(PROBE) => {
                device.is_lost.store(false, Ordering::Relaxed);
                device.clone()
            }
            (Source::Given, _) => return Err(GpuError::Lost),
        };
        Ok(self.device.insert(device).clone())
    }
}

/// Returns true if buffers and forecasts are as they should be after a call with this result.
fn is_sound<T>(result: &Result<T>) -> bool {
    !result.as_ref().is_err_and(GpuError::is_failure)
}

impl PairDevice for GpuFinder {
    fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        wait::block_on(self.run(request, found)).map_err(GpuError::for_core)
    }

    fn name(&self) -> Option<&str> {
        Some(self.adapter()).filter(|name| !name.is_empty() && self.failed.is_none())
    }

    fn is_software(&self) -> bool {
        self.is_software()
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}
