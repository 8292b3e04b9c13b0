//! Runs of single kernels on the device.

use super::*;

/// Returns the device that all tests share.
pub(super) fn gpu() -> &'static GpuFinder {
    static GPU: OnceLock<GpuFinder> = OnceLock::new();
    GPU.get_or_init(|| GpuFinder::new().expect("a device, be it a software one"))
}

/// Returns the device, or none if `PBIG_GPU=none`.
pub(super) fn gpus() -> Option<&'static GpuFinder> {
    (!without_gpu()).then(gpu)
}

/// Runs a kernel on a state, and returns the state afterwards.
pub(super) fn on_device(gpu: &GpuFinder, twin: &Twin, options: &GpuOptions, before: &State) -> State {
    let text = poisoned(twin.kernel);
    run_text(gpu, twin.kernel, twin.groups, &text, options, before)
}

/// Runs a kernel with a text that counts what the kernel does. An edit replaces its first part by its second one.
pub(super) fn counting(kernel: &str, edits: &[[&str; 2]], before: &State) -> State {
    let of_twins = TWINS.iter().map(|twin| (twin.kernel, twin.groups));
    let (kernel, groups) =
        of_twins.chain(SORT).find(|(one, _)| one.name == kernel).expect("a kernel of this name");
    let text = edited(kernel, edits);
    run_text(gpu(), kernel, groups, &text, &GpuOptions::DEFAULT, before)
}

/// Returns the text of a kernel in which each edit replaces its first part by its second one.
pub(super) fn edited(kernel: &Kernel, edits: &[[&str; 2]]) -> String {
    let mut text = poisoned(kernel);
    for [from, to] in edits {
        assert!(text.contains(from), "{} has no {from}", kernel.name);
        text = text.replace(from, to);
    }
    text
}

/// Runs a text of a kernel on a state, and returns the state afterwards.
pub(super) fn run_text(
    gpu: &GpuFinder,
    kernel: &'static Kernel,
    groups: fn(&State) -> u32,
    text: &str,
    options: &GpuOptions,
    before: &State,
) -> State {
    let mut after = before.clone();
    let bindings = kernel.bindings;
    let buffers: Vec<_> = bindings.iter().map(|&buffer| padded(after.bytes(buffer))).collect();
    let left = single::run(gpu, kernel, text, options, &buffers, groups(before));
    for (&buffer, left) in bindings.iter().zip(&left.expect("the device runs the kernel")) {
        let own = after.bytes(buffer);
        let len = own.len();
        own.copy_from_slice(&left[..len]);
    }
    after
}

/// Extends a buffer, because a binding has at least one element even if its list is empty.
pub(super) fn padded(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes.resize(bytes.len().max(64), 0);
    bytes
}

/// Returns the state with capacity for exactly the words that the twin wrote. The input of a sort stays.
pub(super) fn with_capacity_for(before: &State, wanted: &State) -> State {
    if !before.out.is_empty() {
        return before.clone();
    }
    let words = wanted.out.len();
    let mut before = State { out: vec![0; words], ..before.clone() };
    before.chunk.word_capacity = words as u32;
    before
}

pub(super) fn after_twin(twin: &Twin, before: &State) -> State {
    let mut wanted = before.clone();
    (twin.run)(&mut wanted);
    wanted
}

/// Returns the first difference of a kernel and its twin on the same buffers.
pub(super) fn fault(twin: &Twin, options: &GpuOptions, before: &State) -> Option<String> {
    let wanted = after_twin(twin, before);
    let before = with_capacity_for(before, &wanted);
    let found = on_device(gpus()?, twin, options, &before);
    let fault = twin.compare(&before, &found, &wanted)?;
    Some(format!("{}: {fault}", twin.kernel.name))
}

/// Compares a kernel with its twin on all sets of at most `most_boxes` boxes, with and without filters.
pub(super) fn check_agrees(kernel: &str, options: &GpuOptions, most_boxes: usize) {
    for case in cases().into_iter().filter(|case| case.boxes.len() <= most_boxes) {
        let before = State::before(kernel, &case);
        for flags in [0, FILTERED] {
            let fault = fault(twin(kernel), options, &before.clone().with(flags));
            assert_eq!(fault, None, "{}, flags {flags}", case.name);
        }
    }
}
