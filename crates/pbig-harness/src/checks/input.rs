//! Bytes as boxes: short, so that a mutation of one byte is a box that is a little different, equal, touching or odd.

use pbig_core::{Aabb, ProxyFilter};

/// Numbers at which something changes: signs, ends of ranges, no numbers.
const SPECIAL: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::MIN_POSITIVE,
    -1e-45,
    1e-45,
    1e30,
    -1e30,
    f32::MAX,
    -f32::MAX,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    16_777_216.0,
    0.5 * f32::MAX,
];

/// Reads from the front; nothing when the bytes are used up.
pub(super) struct Input<'a>(pub(super) &'a [u8]);

impl Input<'_> {
    pub(super) fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    /// A box, `boxes` being those before it: as six floats, on a raster, as an earlier one with a corner a few ulps
    /// elsewhere, or of special numbers.
    pub(super) fn aabb(&mut self, boxes: &[Aabb]) -> Option<Aabb> {
        let kind = self.byte()?;
        match kind & 3 {
            0 => self.bytes::<24>().map(|bytes| from_floats(bytemuck::pod_read_unaligned(&bytes))),
            1 => self.bytes::<4>().map(|bytes| on_raster(bytes, kind >> 2)),
            2 => self.bytes::<2>().map(|[back, nudge]| like(boxes, back, nudge)),
            _ => self.bytes::<3>().map(special),
        }
    }

    /// A filter of few bodies, kinds and groups, so that many pairs are allowed and many are not.
    pub(super) fn filter(&mut self) -> Option<ProxyFilter> {
        let [body, groups] = self.bytes::<2>()?;
        let bits = |at: u8| u32::from(groups >> at & 3);
        Some(ProxyFilter {
            body: if body & 8 == 0 { ProxyFilter::NO_BODY } else { u32::from(body & 7) },
            kind: 1 << (body >> 4 & 1),
            accepted_kinds: body >> 5 & 3,
            test_mode: u16::from(body >> 7),
            memberships: bits(0) | bits(2) << 8,
            mask: bits(4) | bits(6) << 8 | bits(0),
        })
    }
}

fn from_floats(v: [f32; 6]) -> Aabb {
    Aabb::new([v[0], v[1], v[2]], [v[3], v[4], v[5]])
}

fn on_raster([x, y, z, size]: [u8; 4], scale: u8) -> Aabb {
    let unit = f32::from_bits(u32::from(scale * 4).max(1) << 23);
    let corner = [x, y, z].map(|c| f32::from(c as i8) * unit);
    let edge = |k: usize| f32::from(size >> (2 * k) & 3) * unit * f32::from(1u8 << (size >> 6));
    Aabb::new(corner, std::array::from_fn(|k| corner[k] + edge(k)))
}

fn like(boxes: &[Aabb], back: u8, nudge: u8) -> Aabb {
    let Some(earlier) = boxes.len().checked_sub(1 + usize::from(back)) else { return Aabb::NOWHERE };
    let mut numbers: [f32; 6] = bytemuck::cast(boxes[earlier]);
    let (from, to) = (usize::from(nudge % 6), usize::from(nudge / 6 % 6));
    // Half of the time a corner meets the opposite one, and then is a step beyond it or not.
    numbers[to] = if nudge < 128 { numbers[from] } else { numbers[to] };
    numbers[to] = [numbers[to], numbers[to].next_up(), numbers[to].next_down()][usize::from(nudge % 3)];
    from_floats(numbers)
}

fn special(bytes: [u8; 3]) -> Aabb {
    let number = |i: usize| SPECIAL[usize::from(bytes[i / 2] >> (4 * (i % 2)) & 15)];
    from_floats(std::array::from_fn(number))
}
