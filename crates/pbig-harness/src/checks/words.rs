//! Pairs of a device, and saved bytes, that may be anything: an error, or pairs as they may be; never a panic.

use pbig_core::{Aabb, BroadPhase, Pair, PairList, ProxyFilter};

/// A byte that chooses, and one for the number of boxes; then pairs, or a snapshot.
pub fn decode_words(data: &[u8]) {
    let [format, boxes, rest @ ..] = data else { return };
    if format & 3 == 3 {
        return snapshot(rest);
    }
    let boxes = if format & 4 == 0 { u32::from(*boxes) } else { u32::MAX - u32::from(*boxes) };
    let given: Vec<Pair> = rest.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
    let are_right = given.iter().all(|pair| pair.a < pair.b && pair.b < boxes);
    let mut pairs = PairList::default();
    assert_eq!(pairs.append_checked(&given, boxes).is_ok(), are_right);
    assert_eq!(*pairs, if are_right { &given[..] } else { &[] });
}

/// A restored broad phase goes on without a panic.
fn snapshot(bytes: &[u8]) {
    let Ok(mut restored) = postcard::from_bytes::<BroadPhase>(bytes) else { return };
    for id in 0..restored.id_count().min(40) {
        // An error where the limits were restored as less than what there is.
        _ = restored.set(id, Aabb::from_center([id as f32 * 0.9, 0.0, 0.0], [0.5; 3]), ProxyFilter::ALL);
        _ = restored.update();
    }
    restored.remove(1);
    _ = restored.update();
    assert!(postcard::to_stdvec(&restored).is_ok_and(|bytes| !bytes.is_empty()));
}
