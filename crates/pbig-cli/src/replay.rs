//! `pbig replay`: the incremental path over frames of boxes.

use crate::backend::{BackendArgs, adapter_line, is_software};
use crate::options::{check_output, margin, plan_text, print_summary, search_text, stages};
use pbig_core::{Aabb, BroadPhase, Error, Pair, ProxyFilter};
use pbig_harness::files::{Frames, name, read_frames, write_csv};
use pbig_harness::prelude::*;
use std::path::PathBuf;
use std::time::Instant;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Frames: .npy (F,N,6) float32 or float64; a box of six NaN is absent in that frame. `-` is stdin.
    frames: PathBuf,
    /// File for the events: .csv with frame,event,a,b; `-` is stdout.
    #[arg(short, value_name = "EVENTS.csv")]
    output: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendArgs,
    /// Distance by which a stored box is larger than the given one.
    #[arg(long, value_name = "M", default_value = "0", value_parser = margin, allow_negative_numbers = true)]
    margin: f32,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The events, frame by frame.
#[derive(Default)]
struct Replay {
    lines: Vec<String>,
    times: Vec<f64>,
    added: u64,
    removed: u64,
    invalid: u64,
    /// Frame and index of the first invalid box.
    first_invalid: Option<(usize, usize)>,
    keep_lines: bool,
    /// The reason why the CPU did the work of a wanted device, if it ever did.
    fallback: Option<String>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    check_output("-o", args.output.as_deref(), &["csv"], &args.frames, args.json)?;
    let frames = read_frames(&args.frames)?;
    let about = |error| Failure::Input(format!("{}: {}", name(&args.frames), search_text(&error)));
    let mut broad_phase = args.backend.broad_phase(args.margin)?;
    let mut replay = Replay { keep_lines: args.output.is_some(), ..Replay::default() };
    for frame in tracked(&frames.frames, "frames") {
        replay.step(&mut broad_phase, frame).map_err(about)?;
    }
    args.backend.check_use(broad_phase.device_name(), replay.fallback.as_deref())?;
    if let Some(output) = &args.output {
        write_csv(output, "frame,event,a,b", std::mem::take(&mut replay.lines))?;
    }
    report(args, &frames, &replay, &broad_phase)
}

impl Replay {
    fn step(&mut self, broad_phase: &mut BroadPhase, frame: &[Option<Aabb>]) -> Result<(), Error> {
        // Pairs of a box that leaves end here: the broad phase ends them without an event.
        let mut left: Vec<Pair> = Vec::new();
        let clock = Instant::now();
        for (id, now) in frame.iter().enumerate() {
            match now {
                Some(aabb) => broad_phase.set(id as u32, *aabb, ProxyFilter::ALL)?,
                None => {
                    left.extend(broad_phase.pairs_of(id as u32));
                    broad_phase.remove(id as u32);
                }
            }
        }
        broad_phase.update()?;
        self.times.push(milliseconds(clock.elapsed()));
        self.note_invalid(frame);
        self.invalid += broad_phase.report().invalid;
        self.fallback = self.fallback.take().or_else(|| broad_phase.report().fallback.clone());
        self.count(broad_phase, left);
        Ok(())
    }

    fn note_invalid(&mut self, frame: &[Option<Aabb>]) {
        if self.first_invalid.is_none() {
            let index = frame.iter().position(|now| now.is_some_and(|aabb| !aabb.is_valid()));
            self.first_invalid = index.map(|index| (self.times.len() - 1, index));
        }
    }

    /// Returns a line about the invalid boxes, or nothing if there are none.
    fn invalid_line(&self) -> String {
        let Some((frame, index)) = self.first_invalid else { return String::new() };
        let first = format!("the first in frame {frame}, row {index}, counted from 0");
        format!("invalid boxes, over all frames: {}, {first}\n", self.invalid)
    }

    fn count(&mut self, broad_phase: &BroadPhase, mut removed: Vec<Pair>) {
        let events = broad_phase.events();
        removed.extend_from_slice(&events.removed);
        removed.sort_unstable();
        self.added += events.added.len() as u64;
        self.removed += removed.len() as u64;
        if self.keep_lines {
            let number = self.times.len() - 1;
            let line = |sign: char| move |pair: &Pair| format!("{number},{sign},{},{}", pair.a, pair.b);
            self.lines.extend(removed.iter().map(line('-')));
            self.lines.extend(events.added.iter().map(line('+')));
        }
    }
}

fn report(args: &Args, frames: &Frames, replay: &Replay, broad_phase: &BroadPhase) -> Result<(), Failure> {
    let (boxes, count) = (frames.boxes, frames.frames.len());
    let ms = Spread::of(replay.times.iter().copied());
    let (added, removed) = (replay.added, replay.removed);
    let report = broad_phase.report();
    if args.json {
        let object = serde_json::json!({
            "frames": count,
            "boxes": boxes,
            "added": added,
            "removed": removed,
            "ms": { "min": ms.min, "median": ms.median, "max": ms.max, "per_frame": replay.times },
            "invalid": replay.invalid,
            "pairs": broad_phase.pair_count(),
            "margin": args.margin.abs(),
            "backend": args.backend.in_use(report.fallback.as_deref()),
            "adapter": broad_phase.device_name(),
            "is_software": broad_phase.device_name().map(is_software),
            "plan": plan_text(report),
            "stages": stages(report),
            "fallback": report.fallback,
        });
        return print(&object.to_string());
    }
    let summary = format!(
        "{count} frames of {boxes} boxes: {added} pairs added, {removed} removed, {} at the end\n\
         {}a frame: {ms}\nlast frame: {}{}",
        broad_phase.pair_count(),
        replay.invalid_line(),
        plan_text(report),
        adapter_line(broad_phase.device_name()),
    );
    print_summary(&[args.output.as_deref()], &summary)
}
