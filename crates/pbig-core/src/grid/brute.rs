//! Brute force: every pair is tested.

use super::hits::{Hits, Rule};
use super::record::Record;
use crate::Aabb;
use crate::parallel::run_with;

/// Number of boxes of the larger set in a piece of work.
const PIECE: usize = 4096;

/// Tests every pair of valid boxes; returns how many are valid.
pub(crate) fn brute_force(boxes: &[Aabb], rule: &Rule<'_>, hits: &mut Hits) -> usize {
    let valid = boxes.iter().enumerate().filter(|(_, aabb)| aabb.is_valid());
    let mut records = std::mem::take(&mut hits.records);
    records.clear();
    records.extend(valid.map(|(id, aabb)| Record::new(*aabb, id as u32, 0)));
    for (i, one) in records.iter().enumerate() {
        hits.test_run(one, &records[i + 1..], rule);
        if hits.is_full {
            break;
        }
    }
    let valid = records.len();
    hits.records = records;
    valid
}

/// Tests every valid box of a set against every one of another set, whose ids are behind those of the first; returns how many are
/// valid.
pub(crate) fn brute_force_across(
    first: &[Aabb],
    second: &[Aabb],
    rule: &Rule<'_>,
    hits: &mut [Hits],
) -> usize {
    let sides = [(first, 0), (second, first.len() as u32)];
    let [few, (many, first_id)] = if first.len() <= second.len() { sides } else { [sides[1], sides[0]] };
    run_with(hits, many.len().div_ceil(PIECE), |hits, piece| {
        let start = piece * PIECE;
        let many = &many[start..many.len().min(start + PIECE)];
        test_piece(few, (many, first_id + start as u32), rule, hits);
    });
    first.iter().chain(second).filter(|aabb| aabb.is_valid()).count()
}

/// Tests the valid boxes of a list, given with the id of its first one, against those of another list.
fn test_piece(few: (&[Aabb], u32), many: (&[Aabb], u32), rule: &Rule<'_>, hits: &mut Hits) {
    let records = |(boxes, first_id): (&[Aabb], u32)| {
        let valid = boxes.iter().zip(first_id..).filter(|(aabb, _)| aabb.is_valid());
        valid.map(|(aabb, id)| Record::new(*aabb, id, 0)).collect()
    };
    let (few, many): (Vec<Record>, Vec<Record>) = (records(few), records(many));
    for one in few {
        if hits.is_full {
            return;
        }
        hits.test_run(&one, &many, rule);
    }
}
