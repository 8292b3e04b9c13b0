// What a browser must have for the GPU.

const ADVICE = "Chrome and Edge have it since 113, Firefox since 141, Safari since 26.";
const ADVICE_WITHOUT_GPU =
    "It may be switched off with the graphics acceleration, or the driver may be on the browser's block list.";

/** Returns the adapter that WebGPU prefers. Throws an Error that says why there is none. */
export async function findAdapter(gpu = navigator.gpu, isSecure = isSecureContext) {
    if (!isSecure) throw new Error("This browser has no WebGPU here: it needs https, or localhost.");
    if (!gpu) throw new Error(`This browser has no WebGPU: ${ADVICE}`);
    const adapter = await gpu.requestAdapter({ powerPreference: "high-performance" });
    if (!adapter) throw new Error(`This browser has no WebGPU: it finds no GPU that it supports. ${ADVICE_WITHOUT_GPU}`);
    return adapter;
}

/** Returns why the simulation cannot use the GPU; undefined if it can. */
export async function gpuObstacle(...gpu) {
    try {
        await findAdapter(...gpu);
    } catch (error) {
        return error.message;
    }
    if (WebAssembly.promising) return undefined;
    return "This browser cannot wait for the GPU in the middle of a step: Chrome and Edge can since 137.";
}
