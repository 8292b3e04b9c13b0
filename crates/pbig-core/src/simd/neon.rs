//! Primitives of NEON, which all 64-bit ARM processors have.

use super::{BLOCK, Eight, EightBoxes, Simd, lanewise};
use crate::Aabb;
use std::arch::aarch64::*;

/// A proof that the processor has the instructions: they are part of the architecture. A row is two registers.
#[derive(Clone, Copy)]
pub(crate) struct Neon;

type Row = [uint32x4_t; 2];

/// Evaluates an expression of intrinsics.
macro_rules! by {
    ($expression:expr) => {
        // SAFETY: NEON is part of the architecture; each load and store is of an array that is borrowed.
        unsafe { $expression }
    };
}

/// Applies an instruction to both halves of two rows.
#[inline(always)]
fn zip(a: Row, b: Row, of: impl Fn(uint32x4_t, uint32x4_t) -> uint32x4_t) -> Row {
    [of(a[0], b[0]), of(a[1], b[1])]
}

impl Simd for Neon {
    type Row = Row;

    #[inline(always)]
    fn run<T>(self, work: impl FnOnce() -> T) -> T {
        work()
    }

    #[inline(always)]
    fn load(self, row: &Eight) -> Row {
        by!([vld1q_u32(row.as_ptr()), vld1q_u32(row[4..].as_ptr())])
    }

    #[inline(always)]
    fn store(self, row: Row) -> Eight {
        let mut numbers = [0; BLOCK];
        by!({
            vst1q_u32(numbers.as_mut_ptr(), row[0]);
            vst1q_u32(numbers[4..].as_mut_ptr(), row[1]);
        });
        numbers
    }

    #[inline(always)]
    fn splat(self, number: u32) -> Row {
        by!([vdupq_n_u32(number); 2])
    }

    #[inline(always)]
    fn widen(self, bytes: u64) -> Row {
        by!({
            let numbers = vmovl_u8(vcreate_u8(bytes));
            [vmovl_u16(vget_low_u16(numbers)), vmovl_u16(vget_high_u16(numbers))]
        })
    }

    lanewise! { Row:
        add(a, b) => zip(a, b, |a, b| by!(vaddq_u32(a, b)));
        and(a, b) => zip(a, b, |a, b| by!(vandq_u32(a, b)));
        or(a, b) => zip(a, b, |a, b| by!(vorrq_u32(a, b)));
        min(a, b) => zip(a, b, |a, b| by!(vminq_u32(a, b)));
        max(a, b) => zip(a, b, |a, b| by!(vmaxq_u32(a, b)));
        equal(a, b) => zip(a, b, |a, b| by!(vceqq_u32(a, b)));
        at_most_f32(a, b) => zip(a, b, |a, b| by!(vcleq_f32(vreinterpretq_f32_u32(a), vreinterpretq_f32_u32(b))));
    }

    #[inline(always)]
    fn not(self, a: Row) -> Row {
        by!(a.map(|a| vmvnq_u32(a)))
    }

    #[inline(always)]
    fn select(self, mask: Row, set: Row, unset: Row) -> Row {
        by!([vbslq_u32(mask[0], set[0], unset[0]), vbslq_u32(mask[1], set[1], unset[1])])
    }

    #[inline(always)]
    fn permute(self, row: Row, lanes: Row) -> Row {
        by!({
            let table = uint8x16x2_t(vreinterpretq_u8_u32(row[0]), vreinterpretq_u8_u32(row[1]));
            lanes.map(|lanes| {
                // The numbers of four bytes by lane.
                let lanes = vandq_u32(lanes, vdupq_n_u32(7));
                let bytes = vmlaq_n_u32(vdupq_n_u32(0x0302_0100), lanes, 0x0404_0404);
                vreinterpretq_u32_u8(vqtbl2q_u8(table, vreinterpretq_u8_u32(bytes)))
            })
        })
    }

    #[inline(always)]
    fn bits(self, mask: Row) -> u32 {
        by!({
            let mask = vcombine_u16(vmovn_u32(mask[0]), vmovn_u32(mask[1]));
            // A bit by lane, the first one lowest.
            let bits = vand_u8(vmovn_u16(mask), vcreate_u8(0x8040_2010_0804_0201));
            u32::from(vaddv_u8(bits))
        })
    }

    #[inline(always)]
    fn least(self, row: Row) -> u32 {
        by!(vminvq_u32(vminq_u32(row[0], row[1])))
    }

    #[inline(always)]
    fn lacks_bits(self, add: u64, bits: u64, codes: &[u64; BLOCK]) -> u32 {
        by!({
            let (add, bits, start) = (vdupq_n_u64(add), vdupq_n_u64(bits), codes.as_ptr());
            let has_bit = |codes| vmovn_u64(vtstq_u64(vaddq_u64(add, codes), bits));
            let (a, b) = (has_bit(vld1q_u64(start)), has_bit(vld1q_u64(start.add(2))));
            let (c, d) = (has_bit(vld1q_u64(start.add(4))), has_bit(vld1q_u64(start.add(6))));
            !self.bits([vcombine_u32(a, b), vcombine_u32(c, d)]) & 255
        })
    }

    #[inline(always)]
    fn transpose(self, boxes: [&Aabb; BLOCK]) -> [Row; 6] {
        let (a, b) = (by_axis(&boxes[..4]), by_axis(&boxes[4..]));
        [[a[0], b[0]], [a[1], b[1]], [a[2], b[2]], [a[3], b[3]], [a[4], b[4]], [a[5], b[5]]]
    }

    #[inline(always)]
    fn around(self, boxes: &EightBoxes) -> Aabb {
        let halves = |k: usize| by!([vld1q_f32(boxes[k].as_ptr()), vld1q_f32(boxes[k][4..].as_ptr())]);
        let low = |k: usize| by!(vminvq_f32(vminq_f32(halves(k)[0], halves(k)[1])));
        let high = |k: usize| by!(vmaxvq_f32(vmaxq_f32(halves(k)[0], halves(k)[1])));
        Aabb::new([low(0), low(1), low(2)], [high(3), high(4), high(5)])
    }
}

#[inline(always)]
fn by_axis(boxes: &[&Aabb]) -> [uint32x4_t; 6] {
    // SAFETY: NEON is part of the architecture. A box is six numbers; the loads are of the first four and the last four.
    unsafe {
        let load = |lane: usize, from| vld1q_f32(std::ptr::from_ref(boxes[lane]).cast::<f32>().add(from));
        let [min_x, min_y, min_z, max_x] = transposed([0, 1, 2, 3].map(|lane| load(lane, 0)));
        let [_, _, max_y, max_z] = transposed([0, 1, 2, 3].map(|lane| load(lane, 2)));
        [min_x, min_y, min_z, max_x, max_y, max_z]
    }
}

/// Returns the columns of four rows.
///
/// # Safety
/// The processor has NEON.
#[inline(always)]
unsafe fn transposed([a, b, c, d]: [float32x4_t; 4]) -> [uint32x4_t; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        let [even_ab, odd_ab] = [vtrn1q_f32(a, b), vtrn2q_f32(a, b)].map(|x| vreinterpretq_u64_f32(x));
        let [even_cd, odd_cd] = [vtrn1q_f32(c, d), vtrn2q_f32(c, d)].map(|x| vreinterpretq_u64_f32(x));
        [
            vtrn1q_u64(even_ab, even_cd),
            vtrn1q_u64(odd_ab, odd_cd),
            vtrn2q_u64(even_ab, even_cd),
            vtrn2q_u64(odd_ab, odd_cd),
        ]
        .map(|x| vreinterpretq_u32_u64(x))
    }
}
