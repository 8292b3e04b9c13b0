//! Shows rapier worlds with rapier's own broad phase and with pbig: in a window, or as pictures without one.
//!
//! | files | content |
//! | --- | --- |
//! | `options`, `error` | the command line, and what can go wrong |
//! | `choice`, `engine`, `simulation`, `history` | the broad phase, the world and their times; nothing here draws |
//! | `controls` | keys and what they do |
//! | `figures`, `graph`, `hud`, `sheet` | what is written over the picture, as texts and lines in pixels |
//! | `shapes`, `palette`, `cells`, `framing` | colliders as instances of meshes, their colours, the grid's cells, the camera |
//! | `draw`, `window`, `pictures` | drawing with kiss3d |

pub mod cells;
pub mod choice;
pub mod controls;
pub mod draw;
pub mod engine;
pub mod error;
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
use error::Error;
use options::Options;
use std::process::ExitCode;

/// Runs the program with the options of the command line.
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

async fn run(options: &Options) -> Result<(), Error> {
    let quality = if is_software().await? { Quality::Fast } else { Quality::Fine };
    match &options.frames {
        None => window::run(options, quality).await,
        Some(folder) => pictures::run(options, folder).await,
    }
}

/// Returns true if the graphics adapter is software. The drawing library panics without an adapter, so this says first what is
/// missing.
async fn is_software() -> Result<bool, Error> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let found = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await;
    let adapter = found.map_err(|error| Error::NoAdapter(error.to_string()))?;
    Ok(adapter.get_info().device_type == wgpu::DeviceType::Cpu)
}
