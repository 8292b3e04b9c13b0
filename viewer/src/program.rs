//! The program.

use crate::draw::Quality;
use crate::error::Error;
use crate::options::Options;
use crate::{pictures, window};
use clap::Parser;
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
