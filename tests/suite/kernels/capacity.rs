//! Kernels count what does not fit, and write nothing there.

use super::*;

#[test]
fn nothing_is_checked_once_there_are_too_many_pairs() {
    needs_gpu!();
    for kernel in ["check_small", "check_large", "check_all"] {
        let mut before = State::before(kernel, &pile());
        before.out = vec![0; 1 << 16];
        before.chunk.word_capacity = 1 << 16;
        // As many pairs as fit 32 bits of words, and one less is allowed.
        before.totals.words = NEARLY;
        before.chunk.pairs_left = halves(wide(NEARLY) / 2 - 1);
        let found = on_device(gpu(), twin(kernel), &GpuOptions::DEFAULT, &before);
        assert_eq!((found.totals, &found.out), (before.totals, &before.out), "{kernel}");
    }
}

#[test]
fn checks_count_output_beyond_capacity_and_write_none_there() {
    needs_gpu!();
    for (kernel, case) in [("check_small", pile()), ("check_large", crowd()), ("check_all", pile())] {
        let before = State::before(kernel, &case);
        let wanted = after_twin(twin(kernel), &before);
        let mut before = with_capacity_for(&before, &wanted);
        before.chunk.word_capacity = wanted.out.len() as u32 / 4;
        let found = on_device(gpu(), twin(kernel), &GpuOptions::DEFAULT, &before);
        assert_eq!(same("counts", &counts(&found), &counts(&wanted)), None, "{kernel}");
        let beyond = &found.out[before.chunk.word_capacity as usize..];
        assert!(beyond.iter().all(|&word| word == 0), "{kernel}: written beyond the capacity");
    }
}

#[test]
fn schedule_counts_items_beyond_capacity_and_writes_none_there() {
    needs_gpu!();
    let mut before = State::before("schedule", &pile());
    let wanted = after_twin(twin("schedule"), &before);
    let Counters { entries, slots, small_items, large_items, .. } = wanted.counters;
    let [slots, small, large] = [slots, small_items, large_items].map(|n| n / 2);
    set_capacities(&mut before.params, &[entries, slots, small, large]);
    let found = on_device(gpu(), twin("schedule"), &GpuOptions::DEFAULT, &before);
    assert_eq!(found.counters, wanted.counters);
    assert_eq!(capacity_fault(&found.slots, slots, &wanted.slots), None);
    assert_eq!(capacity_fault(&found.large_items, large, &wanted.large_items), None);
    // The content of a small item depends on the order of the slots.
    let (within, beyond) = found.small_items.split_at(small as usize);
    assert!(within.iter().all(|item| item.pairs > 0), "a gap in the small items");
    assert!(beyond.iter().all(|item| *item == SmallItem::default()), "a small item beyond the capacity");
}

/// Returns an error unless the first `capacity` places of a list hold different wanted elements, and no other is used.
fn capacity_fault<T: Ord + Clone + Debug + Default>(
    found: &[T],
    capacity: u32,
    wanted: &[T],
) -> Option<String> {
    let (within, beyond) = found.split_at(capacity as usize);
    let mut within = sorted(within);
    within.dedup();
    let strange =
        within.iter().find(|item| !wanted.contains(item)).map(|item| format!("{item:?} is not wanted"));
    let twice = (within.len() < capacity as usize).then(|| "something twice".to_owned());
    let too_far = beyond.iter().find(|item| **item != T::default());
    strange.or(twice).or(too_far.map(|item| format!("{item:?} is beyond the capacity")))
}

#[test]
fn scatter_writes_nothing_without_capacity_for_all() {
    needs_gpu!();
    let mut before = State::before("scatter", &pile());
    before.params.entry_capacity -= 1;
    let found = on_device(gpu(), twin("scatter"), &GpuOptions::DEFAULT, &before);
    assert_eq!(same("entries", &found.entries, &before.entries), None);
    assert_eq!(same("cells", &found.cells, &before.cells), None);
}
