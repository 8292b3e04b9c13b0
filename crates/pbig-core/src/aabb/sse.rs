//! One box with another, all axes at once, by instructions of every x86-64.

use super::Extremes;
use crate::Aabb;
use std::arch::x86_64::*;

/// Returns both corners of a box, three lanes each; the fourth holds anything.
#[inline(always)]
pub(crate) fn corners(aabb: &Aabb) -> (__m128, __m128) {
    // SAFETY: SSE is part of the architecture. A box is six numbers; the loads are of the first four and the last four.
    unsafe {
        let first = std::ptr::from_ref(aabb).cast::<f32>();
        let max = _mm_loadu_ps(first.add(2));
        (_mm_loadu_ps(first), _mm_shuffle_ps::<0b00_11_10_01>(max, max))
    }
}

/// See [`Aabb::overlaps`]: 11 instructions, where one axis after the other takes 30.
#[inline(always)]
pub(crate) fn overlaps(one: &Aabb, other: &Aabb) -> bool {
    let ((min, max), (other_min, other_max)) = (corners(one), corners(other));
    // SAFETY: SSE is part of the architecture.
    let axes =
        unsafe { _mm_movemask_ps(_mm_and_ps(_mm_cmple_ps(min, other_max), _mm_cmple_ps(other_min, max))) };
    axes & 7 == 7
}

/// Returns true if two boxes overlap. Behind each lie two numbers, so that both corners can be loaded as four lanes.
#[inline(always)]
pub(crate) fn records_overlap(one: &[f32; 8], other: &[f32; 8]) -> bool {
    // SAFETY: SSE is part of the architecture; each load is of four numbers of eight.
    unsafe {
        let below = _mm_cmple_ps(_mm_loadu_ps(one.as_ptr()), _mm_loadu_ps(other[3..].as_ptr()));
        let above = _mm_cmple_ps(_mm_loadu_ps(other.as_ptr()), _mm_loadu_ps(one[3..].as_ptr()));
        _mm_movemask_ps(_mm_and_ps(below, above)) & 7 == 7
    }
}

/// Returns true if the gaps between a box and one around it are from 0 to `slack` on all sides; none if a gap is NaN, as between
/// equal infinities.
#[inline(always)]
pub(crate) fn gaps_are_within(aabb: &Aabb, outer: &Aabb, slack: f32) -> Option<bool> {
    // SAFETY: SSE is part of the architecture.
    unsafe {
        // Each coordinate goes into a lane. A box that was just computed and is loaded as a whole waits until it is written.
        let [min, max] = [aabb.min, aabb.max].map(|[x, y, z]| _mm_setr_ps(x, y, z, z));
        let (outer_min, outer_max) = corners(outer);
        let (below, above) = (_mm_sub_ps(min, outer_min), _mm_sub_ps(outer_max, max));
        let (zero, slack) = (_mm_setzero_ps(), _mm_set1_ps(slack));
        let least = _mm_and_ps(_mm_cmpge_ps(below, zero), _mm_cmpge_ps(above, zero));
        let most = _mm_and_ps(_mm_cmple_ps(below, slack), _mm_cmple_ps(above, slack));
        let axes = |lanes| _mm_movemask_ps(lanes) & 7;
        let is_within = axes(_mm_and_ps(least, most)) == 7;
        (is_within || axes(_mm_cmpunord_ps(below, above)) == 0).then_some(is_within)
    }
}

/// Returns the extremes of some boxes and earlier ones. Numbers that are NaN do not count.
pub(crate) fn widened<'a>(earlier: Extremes, boxes: impl IntoIterator<Item = &'a Aabb>) -> Extremes {
    let [mut low, mut high, mut extent] = earlier.map(bytemuck::cast::<_, __m128>);
    for (min, max) in boxes.into_iter().map(corners) {
        // SAFETY: SSE is part of the architecture. The second operand wins where the first is NaN.
        (low, high, extent) = unsafe {
            (_mm_min_ps(min, low), _mm_max_ps(max, high), _mm_max_ps(_mm_sub_ps(max, min), extent))
        };
    }
    [low, high, extent].map(bytemuck::cast)
}
