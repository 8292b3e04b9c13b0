//! The device of a finder or a world in a page, which may not wait in a call: the answer is there before the core asks.

use pbig_core::{
    Aabb, Backend, BroadPhase, Config, DeviceFailure, DeviceFound, Finder, Limits, Order, Pair, PairDevice,
    ProxyFilter, Report, SearchRequest,
};
use pbig_gpu::GpuFinder;
use pbig_harness::corpus::difference;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Settings that ask for the device.
pub(super) const ON_DEVICE: Config = Config { backend: Backend::Device, ..Config::DEFAULT };

/// Settings without a device.
pub(super) const ON_CPU: Config = Config { backend: Backend::Cpu, ..Config::DEFAULT };

/// A device that gives the core the answer of another one. A copy of the world asks, and notes the question here; the other device
/// answers it; then the world's own update takes the answer. See [`Relay::ask`].
#[derive(Clone, Debug, Default)]
pub(super) struct Relay(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    answer: Option<Result<DeviceFound, DeviceFailure>>,
    /// The last question without an answer.
    asked: Option<Question>,
}

/// A copy of a [`SearchRequest`].
#[derive(Debug)]
struct Question {
    boxes: Vec<Aabb>,
    filters: Option<Vec<ProxyFilter>>,
    is_sorted: bool,
    max_pairs: u64,
}

impl Question {
    fn of(request: &SearchRequest<'_>) -> Self {
        let &SearchRequest { boxes, filters, is_sorted, max_pairs } = request;
        Self { boxes: boxes.to_vec(), filters: filters.map(<[_]>::to_vec), is_sorted, max_pairs }
    }

    fn request(&self) -> SearchRequest<'_> {
        let &Self { ref boxes, ref filters, is_sorted, max_pairs } = self;
        SearchRequest { boxes, filters: filters.as_deref(), is_sorted, max_pairs }
    }
}

impl Relay {
    /// Returns a world whose device this is.
    pub(super) fn world(&self, config: Config) -> Result<BroadPhase, String> {
        BroadPhase::with_device(config, Box::new(self.clone())).map_err(|error| error.to_string())
    }

    /// Gets the device's answer to the next update of a world. A copy of the world asks the question.
    pub(super) async fn ask(&self, world: &BroadPhase, gpu: &mut GpuFinder) {
        // The update of the copy is the CPU's, and may exceed a limit.
        let _ = world.clone().update();
        let asked = self.state().asked.take();
        if let Some(asked) = asked {
            let mut found = DeviceFound::default();
            let done = gpu.find_all_async(&asked.request(), &mut found).await;
            self.state().answer = Some(done.map(|()| found));
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PairDevice for Relay {
    fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        let mut state = self.state();
        let Some(answer) = state.answer.take() else {
            state.asked = Some(Question::of(request));
            return Err(DeviceFailure::Declined("there is no answer yet".into()));
        };
        *found = answer?;
        Ok(())
    }

    fn name(&self) -> Option<&str> {
        Some("relay")
    }

    fn is_software(&self) -> bool {
        false
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}

/// The pairs of a finder, and its report.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) pairs: Vec<Pair>,
    pub(super) report: Report,
}

/// Finds pairs by a finder with the device.
///
/// # Errors
/// If its bytes differ from those of a finder on the CPU.
pub(super) async fn check(
    gpu: &mut GpuFinder,
    boxes: &[Aabb],
    filters: Option<&[ProxyFilter]>,
) -> Result<Found, String> {
    check_in(Order::Sorted, gpu, boxes, filters).await
}

/// As [`check`], with pairs in this order.
pub(super) async fn check_in(
    order: Order,
    gpu: &mut GpuFinder,
    boxes: &[Aabb],
    filters: Option<&[ProxyFilter]>,
) -> Result<Found, String> {
    let max_pairs = Limits::DEFAULT.max_pairs;
    let request = SearchRequest { boxes, filters, is_sorted: order == Order::Sorted, max_pairs };
    let mut found = DeviceFound::default();
    let done = gpu.find_all_async(&request, &mut found).await;
    compare(order, done.map(|()| found), boxes, filters)
}

/// As [`check_in`], with the answer of the device.
pub(super) fn compare(
    order: Order,
    answer: Result<DeviceFound, DeviceFailure>,
    boxes: &[Aabb],
    filters: Option<&[ProxyFilter]>,
) -> Result<Found, String> {
    let relay = Relay::default();
    relay.state().answer = Some(answer);
    let config = Config { order, ..ON_DEVICE };
    let (mut pairs, report) = find(Finder::with_device(config, Box::new(relay)), boxes, filters)?;
    if order == Order::Unspecified {
        pairs.sort_unstable();
    }
    let (wanted, _) = find(Finder::new(ON_CPU), boxes, filters)?;
    difference(&pairs, &wanted).map_or(Ok(Found { pairs, report }), Err)
}

fn find(
    mut finder: Finder,
    boxes: &[Aabb],
    filters: Option<&[ProxyFilter]>,
) -> Result<(Vec<Pair>, Report), String> {
    let found = match filters {
        Some(filters) => finder.find_filtered(boxes, filters),
        None => finder.find(boxes),
    };
    let pairs = found.map_err(|error| error.to_string())?.to_vec();
    Ok((pairs, finder.report().clone()))
}

/// Returns an error unless a report says that the CPU did the work, and this word of the reason.
pub(super) fn expect(report: &Report, word: &str) -> Result<(), String> {
    match &report.fallback {
        Some(why) if why.contains(word) => Ok(()),
        other => Err(format!("not {word:?} but {other:?} is the reason for the CPU's work")),
    }
}

/// Returns an error if a report says that the CPU did the work.
pub(super) fn expect_device(report: &Report) -> Result<(), String> {
    report.fallback.as_ref().map_or(Ok(()), |why| Err(format!("the CPU did the work: {why}")))
}
