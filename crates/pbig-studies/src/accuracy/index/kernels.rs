//! Kernels that compute pairs from indices.

use pbig_core::GpuOptions;
use pbig_core::layout::{LANES, Params};
use pbig_harness::kernels::Bench;
use pbig_harness::prelude::*;
use pbig_shaders::Kernel;

/// Runs a kernel with a root, with room for so many cells of three words.
pub(crate) fn run(
    bench: &Bench,
    kernel: &'static Kernel,
    root: u32,
    params: Params,
    room: u32,
) -> Result<Vec<u32>, Failure> {
    let options = GpuOptions { root, ..GpuOptions::DEFAULT };
    let bindings = [bytemuck::bytes_of(&params).to_vec(), vec![0; 12 * room as usize]];
    let found = bench.run(kernel, &options, false, &bindings, room.div_ceil(LANES));
    let found = found.map_err(|error| Failure::Input(format!("{}: {error}", kernel.name)))?;
    Ok(bytemuck::pod_collect_to_vec(&found[1]))
}
