//! A device of another crate: it tests every pair on a thread of its own.
//!
//! `cargo run --release --example other_device`

use pbig_core::*;

#[derive(Clone, Debug)]
struct Thread;

/// Returns all pairs, by brute force on a thread.
fn pairs(boxes: &[Aabb], filters: &[ProxyFilter]) -> Result<Vec<Pair>, DeviceFailure> {
    let search = || oracle::pairs_filtered(boxes, filters);
    let found = std::thread::scope(|scope| scope.spawn(search).join());
    found.map_err(|_| DeviceFailure::Failed("the thread panicked".into()))
}

impl PairDevice for Thread {
    fn find_all(&mut self, all: &SearchRequest<'_>, found: &mut DeviceFound) -> Result<(), DeviceFailure> {
        let any = vec![ProxyFilter::ALL; all.boxes.len()];
        found.valid = all.boxes.iter().filter(|one| one.is_valid()).count() as u32;
        found.pairs = pairs(all.boxes, all.filters.unwrap_or(&any))?.into();
        Ok(())
    }

    fn name(&self) -> Option<&str> {
        Some("a thread")
    }

    fn is_software(&self) -> bool {
        true
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}

fn main() -> Result<(), Error> {
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    let mut broad_phase = BroadPhase::with_device(config, Box::new(Thread))?;
    for (id, x) in [(0, 0.0), (1, 0.9), (2, 5.0)] {
        broad_phase.set(id, Aabb::from_center([x, 0.0, 0.0], [0.5; 3]), ProxyFilter::ALL)?;
    }
    println!("{:?}", broad_phase.update()?);
    broad_phase.set(1, Aabb::from_center([4.1, 0.0, 0.0], [0.5; 3]), ProxyFilter::ALL)?;
    println!("{:?}", broad_phase.update()?);
    println!("by {:?}: {}", broad_phase.device_name(), broad_phase.report().plan);
    Ok(())
}
