//! Boxes and pairs that stay on the device: right or incomplete, never wrong, and nothing is made anew where lengths stay.

use super::{cubes, on_cpu, set};
use pbig_core::{Aabb, Config, Finder, Pair, ProxyFilter, oracle};
use pbig_gpu::layout::{COMPLETE, NOT_PLANNED, PLAN_REFUSED, TOO_LARGE};
use pbig_gpu::{DeviceBoxes, DevicePairs, GpuError, GpuFinder, GpuOptions, PairCount, adapters};
use pbig_tests::{corpus, difference, needs_gpu};
use std::sync::mpsc::channel;
use wgpu::BufferUsages as Usage;
use wgpu::util::{BufferInitDescriptor, DeviceExt, DownloadBuffer};

/// Maximum number of calls until one is complete: two for a plan that is refused, one that measures, one each that learn the lengths of
/// lists and that of the pairs, and the last.
const MOST_CALLS: usize = 6;

/// An app with a device of its own, which the finder shares.
pub(super) struct App {
    pub(super) device: wgpu::Device,
    queue: wgpu::Queue,
    pub(super) finder: GpuFinder,
}

impl App {
    pub(super) fn new(options: GpuOptions) -> Self {
        Self::on(&adapters().into_iter().next().expect("an adapter"), options)
    }

    pub(super) fn on(adapter: &wgpu::Adapter, options: GpuOptions) -> Self {
        let device = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()));
        let (device, queue) = device.expect("a device with WebGPU's default limits");
        let finder =
            GpuFinder::from_device(device.clone(), queue.clone()).expect("default limits are enough");
        Self { device, queue, finder: finder.with_options(options) }
    }

    fn buffer<T: bytemuck::Pod>(&self, list: &[T], usage: Usage) -> wgpu::Buffer {
        let contents = bytemuck::cast_slice(list);
        self.device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
    }

    fn boxes(&self, boxes: &[Aabb]) -> wgpu::Buffer {
        self.buffer(boxes, Usage::COPY_SRC | Usage::COPY_DST)
    }

    /// Returns the first bytes of a buffer.
    fn read(&self, buffer: &wgpu::Buffer, bytes: u64) -> Vec<u8> {
        let (sender, receiver) = channel();
        let read = move |read| _ = sender.send(read);
        DownloadBuffer::read_buffer(&self.device, &self.queue, &buffer.slice(..bytes), read);
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("a device that works");
        receiver.recv().expect("a callback").expect("a readable buffer").to_vec()
    }

    /// Returns the result of a search that was submitted.
    fn result(&self, found: &DevicePairs) -> (PairCount, Vec<Pair>) {
        let count: PairCount = bytemuck::pod_read_unaligned(&self.read(&found.count, 32));
        let bytes = 8 * u64::from(count.pairs);
        let pairs = if bytes > 0 { self.read(&found.pairs, bytes) } else { vec![] };
        assert!(count.is_complete() || count.pairs == 0, "{count:?}");
        let mut pairs: Vec<Pair> = bytemuck::pod_collect_to_vec(&pairs);
        pairs.sort_unstable();
        (count, pairs)
    }

    fn search(&mut self, boxes: &DeviceBoxes<'_>) -> (PairCount, Vec<Pair>) {
        let (found, _) = self.finder.submit_pairs(boxes).expect("boxes that can be searched");
        self.result(&found)
    }

    /// Repeats a search until it is complete. Returns the status of each call.
    fn search_all(&mut self, boxes: &DeviceBoxes<'_>) -> (Vec<u32>, Vec<Pair>) {
        let mut status = Vec::new();
        while status.len() < MOST_CALLS {
            let (count, pairs) = self.search(boxes);
            status.push(count.status);
            if count.is_complete() {
                return (status, pairs);
            }
        }
        panic!("not complete: {status:?}");
    }
}

fn all<'a>(buffer: &'a wgpu::Buffer, boxes: &[Aabb]) -> DeviceBoxes<'a> {
    DeviceBoxes { buffer, offset: 0, count: boxes.len() as u32, filters: None }
}

fn scenes() -> Vec<(String, Vec<Aabb>)> {
    let sets = [("unit", 20_000), ("mixed", 5000), ("pile", 3000), ("gaussian", 4000), ("unit", 1024)];
    let sets = sets.map(|(name, n)| (format!("{name} {n}"), set(name, n)));
    let crowd = ("crowd".to_owned(), cubes(1500));
    sets.into_iter()
        .chain([crowd])
        .chain(corpus().into_iter().map(|case| (case.name.to_owned(), case.boxes)))
        .collect()
}

#[test]
fn the_pairs_are_the_oracles_in_every_scene_with_and_without_a_grid() {
    needs_gpu!();
    for all_pairs_up_to in [0, 1024] {
        let mut app = App::new(GpuOptions { all_pairs_up_to, ..GpuOptions::DEFAULT });
        for (name, boxes) in scenes() {
            let wanted = if boxes.len() < 2000 { oracle::pairs(&boxes) } else { on_cpu(&boxes) };
            let buffer = app.boxes(&[&[Aabb::NOWHERE; 1], &boxes[..]].concat());
            let of_app = DeviceBoxes { offset: 24, ..all(&buffer, &boxes) };
            let (_, pairs) = app.search_all(&of_app);
            assert_eq!(difference(&pairs, &wanted), None, "{name}");
            // The plan and the lengths are known now.
            let (count, pairs) = app.search(&of_app);
            assert_eq!((count.status, difference(&pairs, &wanted)), (COMPLETE, None), "{name}, again");
        }
    }
}

#[test]
fn filters_lie_on_the_device_too() {
    needs_gpu!();
    for (name, n) in [("pile", 3000), ("pile", 700)] {
        let mut app = App::new(GpuOptions::DEFAULT);
        let boxes = set(name, n);
        let filter = |i: u32| ProxyFilter { body: i / 3, mask: 1 << (i % 5), ..ProxyFilter::ALL };
        let filters: Vec<_> = (0..n as u32).map(filter).collect();
        let mut cpu = Finder::new(Config::DEFAULT);
        let wanted = cpu.find_filtered(&boxes, &filters).expect("few pairs").to_vec();
        let buffer = app.boxes(&boxes);
        let shifted = [&[ProxyFilter::ALL][..], &filters].concat();
        let of_filters = app.buffer(&shifted, Usage::COPY_SRC);
        let with = DeviceBoxes { filters: Some((&of_filters, 16)), ..all(&buffer, &boxes) };
        assert_eq!(difference(&app.search_all(&with).1, &wanted), None, "{n}");
        let (_, pairs) = app.search_all(&all(&buffer, &boxes));
        assert_eq!(difference(&pairs, &on_cpu(&boxes)), None, "{n}, without filters");
    }
}

#[test]
fn a_call_that_does_not_fit_says_so_and_its_repeat_is_complete() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let mut app = App::new(GpuOptions { first_bytes: 0, ..GpuOptions::DEFAULT });
    let buffer = app.boxes(&boxes);
    let (status, pairs) = app.search_all(&all(&buffer, &boxes));
    assert_eq!(
        status,
        [NOT_PLANNED, TOO_LARGE, TOO_LARGE, COMPLETE],
        "a plan, room for lists, room for pairs"
    );
    assert_eq!(difference(&pairs, &on_cpu(&boxes)), None);
    // Twenty times the pairs, and few of them again.
    let grown: Vec<_> = boxes.iter().map(|b| Aabb::new(b.min, b.max.map(|x| x + 1.0))).collect();
    for next in [&grown, &boxes, &grown] {
        app.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(next));
        let (status, pairs) = app.search_all(&all(&buffer, next));
        assert_eq!(difference(&pairs, &on_cpu(next)), None, "{status:?}");
    }
    let crowd = cubes(300);
    let buffer = app.boxes(&crowd);
    let (count, _) = app.search(&all(&buffer, &crowd));
    let (again, pairs) = app.search(&all(&buffer, &crowd));
    assert!(count.is_complete() || count.needed == again.pairs, "{count:?}, {again:?}");
    assert_eq!(difference(&pairs, &on_cpu(&crowd)), None);
}

/// A plan that was made for other boxes makes too many tests, or too few cells. It costs calls, never a pair.
#[test]
fn boxes_that_jump_together_or_apart_get_another_plan() {
    needs_gpu!();
    let spread = set("unit", 20_000);
    let factor = |by: f32| -> Vec<Aabb> {
        spread.iter().map(|b| Aabb::from_center(b.min.map(|x| x * by), [0.001; 3])).collect()
    };
    let mut app = App::new(GpuOptions::DEFAULT);
    let buffer = app.boxes(&spread);
    let mut all_status = Vec::new();
    for boxes in [spread.clone(), factor(1e-3), factor(1e4), spread.clone()] {
        app.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&boxes));
        for _ in 0..2 {
            let (status, pairs) = app.search_all(&all(&buffer, &boxes));
            assert_eq!(difference(&pairs, &on_cpu(&boxes)), None, "{status:?}");
            all_status.extend(status);
        }
    }
    assert!(all_status.contains(&PLAN_REFUSED), "{all_status:?}");
}

#[test]
fn searches_in_the_callers_encoder_do_not_disturb_each_other() {
    needs_gpu!();
    let sets = [set("unit", 20_000), set("pile", 9000), set("pile", 800)];
    let mut app = App::new(GpuOptions::DEFAULT);
    let buffers = sets.each_ref().map(|boxes| app.boxes(boxes));
    for (buffer, boxes) in buffers.iter().zip(&sets) {
        app.search_all(&all(buffer, boxes));
    }
    // The plan and the lengths are those of the last set: several rounds may be needed.
    let mut seen = [false; 3];
    for round in 0..12 {
        let mut encoder = app.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let copies = [0, 1, 2].map(|i| {
            let found = app.finder.record_pairs(&mut encoder, &all(&buffers[i], &sets[i])).expect("boxes");
            copied(&app, &mut encoder, &found)
        });
        app.queue.submit([encoder.finish()]);
        for (i, copy) in copies.iter().enumerate() {
            let (count, pairs) = app.result(copy);
            seen[i] |= count.is_complete();
            let is_right = || difference(&pairs, &on_cpu(&sets[i]));
            assert!(!count.is_complete() || is_right().is_none(), "set {i}, round {round}: {:?}", is_right());
        }
    }
    assert_eq!(seen, [true; 3], "each is complete once");
}

/// Copies a result, which the next search overwrites.
fn copied(app: &App, encoder: &mut wgpu::CommandEncoder, found: &DevicePairs) -> DevicePairs {
    let copy = |buffer: &wgpu::Buffer, encoder: &mut wgpu::CommandEncoder| {
        let (size, usage) = (buffer.size(), Usage::COPY_SRC | Usage::COPY_DST);
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        let copy = app.device.create_buffer(&descriptor);
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, size);
        copy
    };
    DevicePairs { pairs: copy(&found.pairs, encoder), count: copy(&found.count, encoder) }
}

#[test]
fn nothing_is_made_anew_while_boxes_move_a_little() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let mut app = App::new(GpuOptions::DEFAULT);
    let buffer = app.boxes(&boxes);
    app.search_all(&all(&buffer, &boxes));
    app.search(&all(&buffer, &boxes));
    let made = app.finder.buffers_made();
    let mut last: Option<DevicePairs> = None;
    for call in 1..=100 {
        let moved: Vec<_> =
            boxes.iter().map(|b| Aabb { min: b.min.map(|x| x - 0.001 * call as f32), ..*b }).collect();
        app.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&moved));
        let (found, _) = app.finder.submit_pairs(&all(&buffer, &moved)).expect("boxes");
        assert!(last.is_none_or(|last| last == found), "call {call}: other buffers");
        if call % 25 == 0 {
            let (count, pairs) = app.result(&found);
            assert_eq!((count.status, difference(&pairs, &on_cpu(&moved))), (COMPLETE, None), "call {call}");
        }
        last = Some(found);
    }
    assert_eq!(app.finder.buffers_made(), made);
}

#[test]
fn commands_that_are_never_submitted_cost_no_later_call_its_counts() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let mut app = App::new(GpuOptions::DEFAULT);
    let buffer = app.boxes(&boxes);
    for _ in 0..10 {
        let mut encoder = app.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        app.finder.record_pairs(&mut encoder, &all(&buffer, &boxes)).expect("boxes");
    }
    let (_, pairs) = app.search_all(&all(&buffer, &boxes));
    assert_eq!(difference(&pairs, &on_cpu(&boxes)), None);
}

#[test]
fn wrong_arguments_are_errors_that_name_them_and_harm_nothing() {
    needs_gpu!();
    let boxes = set("pile", 2000);
    let adapter = adapters().into_iter().next().expect("an adapter");
    let mut app = App::on(&adapter, GpuOptions::DEFAULT);
    let (good, storage) = (app.boxes(&boxes), app.buffer(&boxes, Usage::STORAGE));
    let (few, other) = (app.buffer(&[0u32; 8], Usage::COPY_SRC), App::on(&adapter, GpuOptions::DEFAULT));
    let foreign = other.boxes(&boxes);
    let usual = all(&good, &boxes);
    let cases = [
        (DeviceBoxes { buffer: &storage, ..usual }, "needs COPY_SRC"),
        (DeviceBoxes { offset: 2, ..usual }, "begin at byte 2, which is no multiple of 4"),
        (
            DeviceBoxes { offset: 4, ..usual },
            "48000 bytes of boxes from byte 4 on are wanted, but their buffer has 48000",
        ),
        (DeviceBoxes { offset: u64::MAX - 3, ..usual }, "their buffer has 48000"),
        (DeviceBoxes { count: 2001, ..usual }, "48024 bytes of boxes"),
        (DeviceBoxes { count: u32::MAX, ..usual }, "4294967295 boxes, but the device"),
        (
            DeviceBoxes { filters: Some((&few, 0)), ..usual },
            "32000 bytes of filters from byte 0 on are wanted, but their buffer has 32",
        ),
        (DeviceBoxes { filters: Some((&storage, 0)), ..usual }, "the buffer of filters has the usage"),
        (DeviceBoxes { buffer: &foreign, ..usual }, "refused by wgpu"),
    ];
    for (wrong, words) in cases {
        let error = app.finder.submit_pairs(&wrong).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
        let (_, pairs) = app.search_all(&usual);
        assert_eq!(difference(&pairs, &on_cpu(&boxes)), None, "after: {error}");
    }
    for (count, wanted) in [(0, 0), (1, 0), (2, oracle::pairs(&boxes[..2]).len())] {
        let (_, pairs) = app.search_all(&DeviceBoxes { count, ..usual });
        assert_eq!(pairs.len(), wanted, "{count} boxes");
    }
}

#[test]
fn too_little_memory_and_a_lost_device_are_errors() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let mut app = App::new(GpuOptions { max_total_bytes: 1 << 20, ..GpuOptions::DEFAULT });
    let buffer = app.boxes(&boxes);
    let errors = [(); 3].map(|()| app.finder.submit_pairs(&all(&buffer, &boxes)).err());
    let limit = "GpuOptions::max_total_bytes allows 1048576";
    let is_budget =
        |error: &Option<GpuError>| matches!(error, Some(GpuError::Declined(why)) if why.ends_with(limit));
    assert!(errors.iter().any(is_budget), "{errors:?}");
    // The buffers of the call that was declined leave room for fewer boxes.
    let few = &boxes[..2000];
    let (_, pairs) = app.search_all(&DeviceBoxes { count: 2000, ..all(&buffer, &boxes) });
    assert_eq!(difference(&pairs, &on_cpu(few)), None);
    let mut app = App::new(GpuOptions::DEFAULT);
    let buffer = app.boxes(&boxes);
    app.search_all(&all(&buffer, &boxes));
    app.device.destroy();
    let errors = [(); 2].map(|()| app.finder.submit_pairs(&all(&buffer, &boxes)).err());
    assert_eq!(errors.last(), Some(&Some(GpuError::Lost)), "{errors:?}");
}
