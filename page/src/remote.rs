//! The GPU as the page's broad phase asks it. In a browser the answer comes later, and rapier's step cannot be left and
//! entered again. So the browser suspends the whole module until then (WebAssembly's JavaScript promise integration).

use pbig_core::{Aabb, DeviceFailure, DeviceFound, Pair, PairDevice, ProxyFilter, SearchRequest};

/// Returns all pairs of the boxes that their filters, if any, allow; none if the device declines the call.
pub(crate) type FindAll = fn(&[Aabb], Option<&[ProxyFilter]>) -> Option<Vec<Pair>>;

/// A device that another module is, which finds all pairs in each call.
#[derive(Clone, Debug)]
pub(crate) struct RemoteDevice {
    pub(crate) find_all: FindAll,
}

impl RemoteDevice {
    /// Returns the GPU of the page.
    pub(crate) fn gpu() -> Self {
        Self { find_all: find_on_gpu }
    }
}

impl PairDevice for RemoteDevice {
    fn find_all(&mut self, all: &SearchRequest<'_>, found: &mut DeviceFound) -> Result<(), DeviceFailure> {
        let declined = || DeviceFailure::Declined("the GPU declined the boxes: the CPU does the work".into());
        found.pairs = (self.find_all)(all.boxes, all.filters).ok_or_else(declined)?.into();
        found.valid = all.boxes.iter().filter(|one| one.is_valid()).count() as u32;
        if found.pairs.len() as u64 > all.max_pairs { Err(DeviceFailure::TooManyPairs) } else { Ok(()) }
    }

    fn name(&self) -> Option<&str> {
        Some("WebGPU")
    }

    fn is_software(&self) -> bool {
        false
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}

/// Asks the page's GPU, and suspends the module until it answers. A GPU that fails has declined; `web/device.js` keeps the error.
#[cfg(target_family = "wasm")]
fn find_on_gpu(boxes: &[Aabb], filters: Option<&[ProxyFilter]>) -> Option<Vec<Pair>> {
    use wasm_bindgen::prelude::wasm_bindgen;

    // Without wasm-bindgen, whose JavaScript around a function cannot be suspended.
    #[link(wasm_import_module = "pbig-page-device")]
    unsafe extern "C" {
        fn find_pairs(boxes: *const Aabb, filters: *const ProxyFilter, count: usize);
    }
    #[wasm_bindgen(raw_module = "pbig-page-device")]
    extern "C" {
        fn take_pairs() -> Option<Vec<u32>>;
    }
    let filters = filters.map_or(std::ptr::null(), <[_]>::as_ptr);
    // SAFETY: `web/device.js` reads `boxes.len()` boxes and, unless the pointer is null, as many filters.
    unsafe { find_pairs(boxes.as_ptr(), filters, boxes.len()) };
    Some(take_pairs()?.as_chunks().0.iter().map(|&[a, b]| Pair { a, b }).collect())
}

#[cfg(not(target_family = "wasm"))]
fn find_on_gpu(_: &[Aabb], _: Option<&[ProxyFilter]>) -> Option<Vec<Pair>> {
    panic!("the page's GPU is that of a browser")
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::{Backend, BroadPhase, Config, oracle};

    fn brute_force(boxes: &[Aabb], filters: Option<&[ProxyFilter]>) -> Option<Vec<Pair>> {
        Some(oracle::pairs_filtered(boxes, filters.unwrap_or(&vec![ProxyFilter::ALL; boxes.len()])))
    }

    /// Sets, moves, filters anew or removes a box, as a number says.
    fn change(broad_phase: &mut BroadPhase, id: u32, number: u32) {
        if number.is_multiple_of(5) {
            broad_phase.remove(id);
            return;
        }
        let at = [number % 7, number % 11, number % 3].map(|x| x as f32);
        let filter = ProxyFilter { body: number % 13, ..ProxyFilter::ALL };
        broad_phase.set(id, Aabb::from_center(at, [1.2; 3]), filter).unwrap();
    }

    /// A device that finds all pairs gives each update the events of the CPU.
    #[test]
    fn updates_have_the_events_of_the_cpu() {
        let config = Config { backend: Backend::Device, ..Config::DEFAULT };
        let device = RemoteDevice { find_all: brute_force };
        let mut both = [
            BroadPhase::with_device(config, Box::new(device)).unwrap(),
            BroadPhase::new(Config::DEFAULT).unwrap(),
        ];
        let mut events = 0;
        for step in 0..40 {
            for number in (0..12).map(|k: u32| (step * 12 + k).wrapping_mul(2_654_435_761) >> 8) {
                both.iter_mut().for_each(|it| change(it, number % 60, number / 60));
            }
            let [found, expected] = both.each_mut().map(|it| it.update().unwrap().clone());
            assert_eq!(found, expected, "step {step}");
            assert_eq!(both[0].report().fallback, None);
            events += found.added.len() + found.removed.len();
        }
        assert!(events > 1000, "too few events: {events}");
    }
}
