//! A device that tests every pair, and that fails or lies if it is told to.

use pbig_core::{Aabb, DeviceFailure, DeviceFound, Pair, PairDevice, ProxyFilter, SearchRequest, oracle};

/// A fault of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Nothing,
    /// Every second call fails.
    Fails,
    /// From the third call on it fails after half of the answer.
    IsLost,
    /// Pairs are out of order, which they may be.
    Disorder,
    /// Each pair comes twice, out of order.
    Twice,
    /// A pair names a box beyond the last one.
    BeyondTheLast,
    /// A pair names the larger id first.
    Inverted,
    /// It counts more valid boxes than there are boxes.
    MoreThanAll,
    /// It counts no valid boxes.
    CountsNone,
    /// It leaves out half of the pairs.
    TooFew,
    /// It adds pairs of boxes that are apart.
    TooMany,
    /// It adds pairs of ids that have no box.
    Nowhere,
    /// It leaves every second call to the CPU.
    Declines,
    /// It finds more pairs than it may.
    IgnoresLimits,
}

#[derive(Clone, Debug)]
pub(super) struct Double {
    pub(super) fault: Fault,
    pub(super) is_software: bool,
    calls: u32,
}

impl Double {
    pub(super) fn new(fault: Fault) -> Box<Self> {
        Box::new(Self { fault, is_software: false, calls: 0 })
    }

    /// Spoils a right answer about some boxes.
    fn spoil(&mut self, found: &mut DeviceFound, all: &[Aabb]) -> Result<(), DeviceFailure> {
        self.calls += 1;
        let (n, calls, boxes) = (all.len() as u32, self.calls, all.len());
        match self.fault {
            Fault::Fails if calls.is_multiple_of(2) => return Err(DeviceFailure::Failed("no luck".into())),
            Fault::Declines if calls.is_multiple_of(2) => {
                return Err(DeviceFailure::Declined("a crowd".into()));
            }
            Fault::IsLost if calls > 2 => {
                let half = found.pairs.len() / 2;
                found.pairs.truncate(half);
                return Err(DeviceFailure::Failed("lost".into()));
            }
            Fault::Disorder => found.pairs.reverse(),
            Fault::Twice => found.pairs.extend_from_within(..),
            Fault::BeyondTheLast => found.pairs.push(Pair { a: 0, b: n }),
            Fault::Inverted => found.pairs.push(Pair { a: n - 1, b: 0 }),
            Fault::MoreThanAll => found.valid = n + 1,
            Fault::CountsNone => {
                found.valid = 0;
                found.pairs.reverse();
            }
            Fault::TooFew => found.pairs.retain(|pair| (pair.a + pair.b).is_multiple_of(2)),
            Fault::TooMany => found.pairs.extend(some_pairs(boxes).step_by(4)),
            Fault::Nowhere => {
                let is_nowhere = |id: u32| !all[id as usize].is_valid();
                found.pairs.extend(some_pairs(boxes).filter(|pair| is_nowhere(pair.a) || is_nowhere(pair.b)));
            }
            _ => {}
        }
        Ok(())
    }
}

/// Returns pairs of which most do not overlap.
fn some_pairs(boxes: usize) -> impl Iterator<Item = Pair> {
    let n = boxes as u32;
    (1..n).map(move |b| Pair { a: b * 7 % b.max(2) / 2, b })
}

impl PairDevice for Double {
    fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        found: &mut DeviceFound,
    ) -> Result<(), DeviceFailure> {
        let all = vec![ProxyFilter::ALL; request.boxes.len()];
        found.pairs = oracle::pairs_filtered(request.boxes, request.filters.unwrap_or(&all)).into();
        found.valid = request.boxes.iter().filter(|one| one.is_valid()).count() as u32;
        if found.pairs.len() as u64 > request.max_pairs && self.fault != Fault::IgnoresLimits {
            return Err(DeviceFailure::TooManyPairs);
        }
        self.spoil(found, request.boxes)
    }

    fn name(&self) -> Option<&str> {
        (self.fault != Fault::IsLost || self.calls <= 2).then_some("a double")
    }

    fn is_software(&self) -> bool {
        self.is_software
    }

    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}
