// The module of the GPU, which is loaded when it is needed.

import init, { Gpu, panic_message } from "pbig-page-gpu-module";
import { describe, loadModule } from "./load.js";
import { gpuObstacle } from "./webgpu.js";

const MODULE = "pbig_page_gpu_bg.wasm";

/** Opens the GPU. Returns a function from boxes and filters to a promise of their pairs. */
export async function openGpu() {
    const obstacle = await gpuObstacle();
    if (obstacle) throw new Error(obstacle);
    await loadModule(init, MODULE);
    const gpu = await Gpu.open();
    return (boxes, filters) => gpu.find(boxes, filters).catch((error) => fail(error));
}

function fail(error) {
    throw new Error(`The GPU failed: ${describe(error, panic_message)}`);
}
