//! Where pairs go, and what is counted on the way.

use crate::cpu::found::Found;
use crate::layout::{Totals, wide};
use crate::report::{Checks, GpuReport};
use crate::{Error, Pair};
use rayon::prelude::*;
use std::time::Duration;

/// Where pairs go.
pub(super) struct Sink<'a> {
    pub(super) found: &'a mut Found,
    /// Buffers of `found` that are in use.
    pub(super) used: usize,
    pub(super) pairs: u64,
    /// Pairs that the device wrote, wanted or not.
    pub(super) written: u64,
    pub(super) limit: u64,
    /// What the boxes of the job are called.
    pub(super) ids: Option<&'a [u32]>,
    /// Whether a pair is wanted, beyond what the device has tested.
    pub(super) accept: Option<&'a (dyn Fn(u32, u32) -> bool + Sync)>,
    pub(super) checks: Checks,
    pub(super) report: GpuReport,
}

impl Sink<'_> {
    /// How many more pairs the device may count: any number where that is not what the limit is about.
    pub(super) fn left(&self) -> u64 {
        if self.accept.is_some() { u64::MAX } else { self.limit.saturating_sub(self.pairs) }
    }

    pub(super) fn add(&mut self, pieces: Vec<Vec<Pair>>) -> Result<(), Error> {
        let (ids, accept) = (self.ids, self.accept);
        let settle = |mut piece: Vec<Pair>| {
            if let Some(ids) = ids {
                piece.iter_mut().for_each(|p| *p = Pair::new(ids[p.a as usize], ids[p.b as usize]));
            }
            if let Some(accept) = accept {
                piece.retain(|p| accept(p.a, p.b));
            }
            piece
        };
        let pieces: Vec<Vec<Pair>> = pieces.into_par_iter().map(settle).collect();
        self.pairs += pieces.iter().map(|piece| piece.len() as u64).sum::<u64>();
        if self.pairs > self.limit {
            return Err(Error::TooManyPairs { limit: self.limit });
        }
        for piece in pieces {
            self.found.put(self.used, piece);
            self.used += 1;
        }
        Ok(())
    }

    pub(super) fn count(&mut self, totals: &Totals) {
        let (made, redundant, overlaps) = (wide(totals.made), wide(totals.redundant), wide(totals.overlaps));
        self.checks.made += made;
        self.checks.redundant += redundant;
        self.checks.unnecessary += made.saturating_sub(redundant + overlaps);
        self.written += wide(totals.pairs);
        self.found.overlaps += overlaps;
        self.found.checks += made;
    }

    /// Adds device times to those of the same kernels before.
    pub(super) fn add_times(&mut self, times: &[(&'static str, Duration)]) {
        for &(name, time) in times {
            match self.report.kernels.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += time,
                None => self.report.kernels.push((name, time)),
            }
        }
    }
}
