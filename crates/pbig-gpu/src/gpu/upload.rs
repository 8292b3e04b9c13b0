//! Upload: each list is copied once into staging memory. Boxes go up as they are, and a kernel turns them into ordered
//! integers. Updates send only the changes that the caller lists.
//!
//! A finder sends all boxes in each call: to find those that have changed, the host would have to read them and a copy of the
//! last call's, which takes longer than sending them.

use super::GpuError;
use super::changes::Changes;
use super::passes::changed_bytes;
use super::storage::{Storage, Upload};
use crate::layout::{BoxChange, FilterChange, Motion, Params};
use bytemuck::Pod;
use pbig_core::ProxyFilter;
use pbig_shaders::Buffer;

/// Fewest elements for a thread: 10 us of work.
pub(super) const PIECE: usize = 1 << 14;

/// Uploads all boxes, or boxes now and before, whatever the device has. Sets the number of boxes in `params`.
pub(super) fn upload_all<T: Pod>(
    storage: &mut Storage,
    boxes: &[T],
    filters: Option<&[ProxyFilter]>,
    params: &mut Params,
) -> Result<(), GpuError> {
    storage.known = None;
    params.boxes = boxes.len() as u32;
    make_room(storage, size_of_val(boxes), filters.map_or(0, size_of_val), params.boxes)?;
    let filters = filters.unwrap_or(&[]);
    storage.stage(&[Upload::new(Buffer::Boxes, 0, boxes), Upload::new(Buffer::Filters, 0, filters)])
}

/// Uploads the changes, or all boxes to a device that does not have those of the last update. Sets the lengths of the lists in
/// `params`.
pub(super) fn upload_changes(
    storage: &mut Storage,
    changes: Changes<'_>,
    params: &mut Params,
) -> Result<(), GpuError> {
    let (boxes, filters) = (changes.boxes.len(), changes.filters);
    params.boxes = boxes as u32;
    let (bytes, filter_bytes) = (boxes * size_of::<Motion>(), size_of_val(filters));
    let has_lost_content = make_room(storage, bytes, filter_bytes, params.boxes)?;
    match storage.known.filter(|_| !has_lost_content) {
        Some(known) => send_lists(storage, changes, known.min(boxes), params)?,
        None => upload_all(storage, &changes.motions(0..boxes), Some(filters), params)?,
    }
    storage.known = Some(boxes);
    Ok(())
}

/// Makes the buffers of boxes. Returns true if one of them has lost its content.
fn make_room(storage: &mut Storage, boxes: usize, filters: usize, count: u32) -> Result<bool, GpuError> {
    storage.ensure(Buffer::Changed, changed_bytes(count))?;
    Ok(storage.ensure(Buffer::Boxes, boxes as u64)? | storage.ensure(Buffer::Filters, filters as u64)?)
}

/// Sends the lists of changes of the first `known` boxes, and the boxes after these.
fn send_lists(
    storage: &mut Storage,
    changes: Changes<'_>,
    known: usize,
    params: &mut Params,
) -> Result<(), GpuError> {
    let new = changes.motions(known..changes.boxes.len());
    let changed = changes.of_known(known);
    let of_known = Changes { changed: &changed, ..changes };
    let mut uploads = vec![
        Upload::new(Buffer::Boxes, known, &new),
        Upload::new(Buffer::Filters, known, &changes.filters[known..]),
        Upload::of_box_changes(of_known),
    ];
    let (lists, mut filter_changes) = (of_known.filter_changes(), 0);
    for filters in &lists {
        uploads.push(Upload::new(Buffer::FilterChanges, filter_changes, filters));
        filter_changes += filters.len();
    }
    storage.ensure(Buffer::BoxChanges, size_of::<BoxChange>() as u64 * changed.len() as u64)?;
    storage.ensure(Buffer::FilterChanges, (filter_changes * size_of::<FilterChange>()) as u64)?;
    storage.stage(&uploads)?;
    params.known = known as u32;
    (params.box_changes, params.filter_changes) = (changed.len() as u32, filter_changes as u32);
    Ok(())
}
