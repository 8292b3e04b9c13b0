//! Shows rapier worlds with rapier's own broad phase and with pbig: in a window, or as pictures without one.
//!
//! | files | content |
//! | --- | --- |
//! | `options` | the command line |
//! | `choice`, `simulation`, `history` | the broad phase, the world and their times; nothing here draws |
//! | `controls` | keys and what they do |
//! | `figures`, `graph`, `hud`, `sheet` | what is written over the picture, as texts and lines in pixels |
//! | `shapes`, `palette`, `framing` | parts of colliders as instances, their colours, the camera |
//! | `draw`, `window`, `pictures` | drawing with kiss3d |

#![allow(missing_docs, reason = "a program, whose names say most")]

pub mod choice;
pub mod controls;
pub mod draw;
pub mod figures;
pub mod framing;
pub mod graph;
pub mod history;
pub mod hud;
pub mod options;
pub mod palette;
pub mod pictures;
pub mod shapes;
pub mod sheet;
pub mod simulation;
pub mod window;

use clap::Parser;
use draw::Quality;
use options::Options;
use std::process::ExitCode;

pub fn main() -> ExitCode {
    let options = Options::parse();
    match kiss3d::pollster::block_on(run(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

async fn run(options: &Options) -> Result<(), String> {
    let quality = if is_software().await? { Quality::Fast } else { Quality::Fine };
    match &options.frames {
        None => window::run(options, quality).await,
        Some(folder) => pictures::run(options, folder).await,
    }
}

/// Returns true if the graphics adapter is software. The drawing library panics without an adapter, so this says first what is
/// missing.
async fn is_software() -> Result<bool, String> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let found = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await;
    let adapter = found.map_err(|error| {
        format!(
            "there is no graphics adapter: {error}\na software one will do; on Debian and Ubuntu: \
             apt install mesa-vulkan-drivers libvulkan1"
        )
    })?;
    Ok(adapter.get_info().device_type == wgpu::DeviceType::Cpu)
}
