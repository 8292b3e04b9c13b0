//! Boxes that live on the device: one shader moves them, pbig finds their pairs there, and another shader counts each box's
//! partners. Nothing but a few counts crosses the bus.
//!
//! `cargo run --release --example resident`

use pbig_gpu::{DeviceBoxes, DevicePairs, GpuFinder, PairCount};
use wgpu::BufferUsages as Usage;

const BOXES: u32 = 20_000;
const FRAMES: u32 = 20;

/// Places boxes in the first frame, and moves them in the others.
const MOVE: &str = "
struct Box { low: array<f32, 3>, high: array<f32, 3> }
@group(0) @binding(0) var<storage, read_write> boxes: array<Box>;

fn random(seed: u32) -> f32 {
    let mixed = (seed ^ (seed >> 16u)) * 0x7feb352du;
    return f32((mixed ^ (mixed >> 15u)) * 0x846ca68bu >> 8u) / 16777216.0;
}

@compute @workgroup_size(256)
fn run(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&boxes) { return; }
    for (var axis = 0u; axis < 3u; axis++) {
        let seed = 6u * id.x + axis;
        let is_new = boxes[id.x].low[axis] == boxes[id.x].high[axis];
        let moved = boxes[id.x].low[axis] + 0.1 * (random(seed + 3u) - 0.5);
        let low = select(clamp(moved, 0.0, 30.0), 30.0 * random(seed), is_new);
        boxes[id.x].low[axis] = low;
        boxes[id.x].high[axis] = low + 1.0;
    }
}";

/// Counts the partners of each box: one lane for each pair.
const COUNT: &str = "
@group(0) @binding(0) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(1) var<storage, read> found: array<u32, 8>;
@group(0) @binding(2) var<storage, read_write> partners: array<atomic<u32>>;
// The largest number of partners.
@group(0) @binding(3) var<storage, read_write> most: atomic<u32>;

@compute @workgroup_size(256)
fn run(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = 256u * (32768u * group.y + group.x) + lane;
    if i >= found[0] { return; }
    for (var side = 0u; side < 2u; side++) {
        atomicMax(&most, atomicAdd(&partners[pairs[i][side]], 1u) + 1u);
    }
}";

type Failure = Box<dyn std::error::Error>;

struct App {
    device: wgpu::Device,
    queue: wgpu::Queue,
    finder: GpuFinder,
    move_boxes: wgpu::ComputePipeline,
    count_partners: wgpu::ComputePipeline,
    boxes: wgpu::Buffer,
    partners: wgpu::Buffer,
    most: wgpu::Buffer,
    /// A [`PairCount`] and the largest number of partners, for the host.
    counts: wgpu::Buffer,
}

impl App {
    fn open() -> Result<Self, Failure> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
        // By default a buffer has at most 128 MiB: 5.6 million boxes.
        let limits = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&limits))?;
        Ok(Self {
            finder: GpuFinder::from_device(device.clone(), queue.clone())?,
            move_boxes: pipeline(&device, MOVE),
            count_partners: pipeline(&device, COUNT),
            // pbig copies the boxes on the device.
            boxes: buffer(&device, 24 * u64::from(BOXES), Usage::STORAGE | Usage::COPY_SRC),
            partners: buffer(&device, 4 * u64::from(BOXES), Usage::STORAGE | Usage::COPY_DST),
            most: buffer(&device, 4, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC),
            counts: buffer(&device, 36, Usage::MAP_READ | Usage::COPY_DST),
            device,
            queue,
        })
    }

    /// Moves the boxes, finds their pairs and counts partners, in one submission.
    fn frame(&mut self) -> Result<(), Failure> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let moved = self.bind(&self.move_boxes, &[&self.boxes]);
        run(&mut encoder, &self.move_boxes, &moved, |pass| {
            pass.dispatch_workgroups(BOXES.div_ceil(256), 1, 1)
        });
        let boxes = DeviceBoxes { buffer: &self.boxes, offset: 0, count: BOXES, filters: None };
        let found = self.finder.record_pairs(&mut encoder, &boxes)?;
        self.record_count(&mut encoder, &found);
        encoder.copy_buffer_to_buffer(&found.count, 0, &self.counts, 0, 32);
        encoder.copy_buffer_to_buffer(&self.most, 0, &self.counts, 32, 4);
        self.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Counts partners: the device decides how many workgroups that takes.
    fn record_count(&self, encoder: &mut wgpu::CommandEncoder, found: &DevicePairs) {
        encoder.clear_buffer(&self.partners, 0, None);
        encoder.clear_buffer(&self.most, 0, None);
        let buffers = [&found.pairs, &found.count, &self.partners, &self.most];
        let count = self.bind(&self.count_partners, &buffers);
        let dispatch = |pass: &mut wgpu::ComputePass<'_>| {
            pass.dispatch_workgroups_indirect(&found.count, PairCount::DISPATCH_AT)
        };
        run(encoder, &self.count_partners, &count, dispatch);
    }

    fn bind(&self, pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let bound = buffers.iter().map(|buffer| buffer.as_entire_binding());
        let entry = |(binding, resource)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<_> = (0..).zip(bound).map(entry).collect();
        let layout = &pipeline.get_bind_group_layout(0);
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    /// Reads the counts of the last frame: 36 bytes. An app would not wait for them.
    fn counts(&self) -> Result<[u32; 9], Failure> {
        self.counts.map_async(wgpu::MapMode::Read, .., |_| {});
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        let words = self.counts.get_mapped_range(..)?.as_chunks::<4>().0.to_vec();
        self.counts.unmap();
        Ok(std::array::from_fn(|i| u32::from_le_bytes(words[i])))
    }
}

fn buffer(device: &wgpu::Device, size: u64, usage: Usage) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}

fn pipeline(device: &wgpu::Device, text: &str) -> wgpu::ComputePipeline {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("run"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn run(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    group: &wgpu::BindGroup,
    dispatch: impl FnOnce(&mut wgpu::ComputePass<'_>),
) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    dispatch(&mut pass);
}

fn main() -> Result<(), Failure> {
    let mut app = App::open()?;
    println!("{BOXES} boxes on {}", app.finder.adapter());
    for frame in 0..FRAMES {
        app.frame()?;
        let [pairs, status, .., most] = app.counts()?;
        // The first frames measure the boxes and learn how much room the pairs need.
        let state = if status == 0 { "complete" } else { "to be repeated" };
        println!("frame {frame}: {pairs} pairs, {state}; at most {most} partners of a box");
    }
    let is_complete = app.counts()?[1] == 0;
    if is_complete { Ok(()) } else { Err("the last frame is not complete".into()) }
}
