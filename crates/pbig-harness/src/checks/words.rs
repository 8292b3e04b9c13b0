//! Words of a device, and saved bytes, that may be anything: an error, or pairs as they may be; never a panic.

use pbig_core::{Aabb, BoxIds, BroadPhase, PairList, ProxyFilter};
use pbig_gpu::decode;

/// A byte for the format, one for the number of boxes, one for that of entries; then words, entries first.
pub fn decode_words(data: &[u8]) {
    let [format, boxes, entries, rest @ ..] = data else { return };
    let words: Vec<u32> = rest.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
    let (entries, output) = words.split_at(words.len().min(usize::from(*entries)));
    let boxes = if format & 4 == 0 { u32::from(*boxes) } else { u32::MAX - u32::from(*boxes) };
    let (mut pairs, ids) = (PairList::default(), BoxIds::First(boxes));
    let found = match format & 3 {
        0 => decode::plain(output, ids, format & 16 != 0, &mut pairs),
        1 => decode::records(output, entries, ids, &mut pairs),
        2 => decode::bits(output, ids, &mut pairs),
        _ => return snapshot(rest),
    };
    if found.is_err() {
        return;
    }
    assert!(pairs.iter().all(|pair| pair.a < pair.b && pair.b < boxes), "no pairs of {boxes} boxes");
    // A row takes a byte for each partner, a bit is one pair.
    assert!(pairs.len() <= 32 * output.len(), "{} pairs of {} words", pairs.len(), output.len());
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
