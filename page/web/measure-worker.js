// Measures the GPU apart from the page, which stays responsive. The page ends the worker to cancel.

import { describe, loadModule } from "./load.js";
import init, { Benchmark, panic_message } from "pbig-page-gpu-module";
import { KERNEL_ROUNDS, roundsOf, rowOf, SET, workOf } from "./measurement.js";
import { findAdapter } from "./webgpu.js";

const MODULE = "pbig_page_gpu_bg.wasm";
let done = 0;

onmessage = async ({ data: { sizes } }) => {
    try {
        const adapter = await findAdapter();
        await measure(adapter, sizes).catch(stop);
        postMessage({ kind: "end" });
    } catch ({ message }) {
        postMessage({ kind: "failure", text: message });
    }
};

function stop(error) {
    throw new Error(`The measurement stopped: ${describe(error, panic_message)}.`);
}

async function measure(adapter, sizes) {
    await loadModule(init, MODULE);
    tell(sizes, "Opening the GPU");
    const benchmark = await Benchmark.open();
    postMessage({ kind: "device", conditions: conditionsOf(benchmark, adapter) });
    for (const boxes of sizes) postMessage({ kind: "row", row: await measureBoxes(benchmark, boxes, sizes) });
}

async function measureBoxes(benchmark, boxes, sizes) {
    benchmark.set_boxes(SET, boxes);
    const [rounds, count] = [[], roundsOf(boxes)];
    let isEqual = true;
    for (let round = 0; round < count; round++) {
        tell(sizes, `${boxes.toLocaleString("en")} boxes, round ${round + 1} of ${count}`);
        const times = await measureRound(benchmark, round);
        isEqual &&= benchmark.has_equal_pairs();
        if (round > 0) rounds.push(times);
        done += boxes;
    }
    const pairs = benchmark.pair_count();
    return rowOf({ boxes, pairs, rounds, isEqual, kernels: await measureKernels(benchmark, boxes, sizes) });
}

async function measureRound(benchmark, round) {
    const start = performance.now();
    benchmark.find_on_cpu(round);
    const middle = performance.now();
    await benchmark.find_on_gpu(round, false);
    const end = performance.now();
    return { cpu_ms: middle - start, gpu_ms: end - middle, ...reportOf(benchmark) };
}

function reportOf(benchmark) {
    const report = benchmark.report();
    const { wait_ms, upload_ms, plan_ms, record_ms, decode_ms } = report;
    const { uploaded_bytes, downloaded_bytes, device_bytes } = report;
    report.free();
    return { wait_ms, upload_ms, plan_ms, record_ms, decode_ms, uploaded_bytes, downloaded_bytes, device_bytes };
}

/** Returns the milliseconds of each kernel in the last of some rounds; none if the GPU does not tell the time. */
async function measureKernels(benchmark, boxes, sizes) {
    for (let round = 0; round < KERNEL_ROUNDS; round++) {
        tell(sizes, `${boxes.toLocaleString("en")} boxes, kernel by kernel`);
        if (benchmark.has_timestamps()) await benchmark.find_on_gpu(round, true);
        done += boxes;
    }
    return benchmark.has_timestamps() ? Object.fromEntries(benchmark.kernels().map((it) => [it.name, it.ms])) : {};
}

function conditionsOf(benchmark, adapter) {
    const { vendor, architecture, device, description, isFallbackAdapter } = adapter.info;
    // A browser may hide each of them.
    const names = [description || device, vendor, architecture].filter(Boolean);
    return {
        adapter: names.join(", ") || "unknown",
        software: isFallbackAdapter === true,
        browser: navigator.userAgent,
        limits: benchmark.limits(),
        timestamps: benchmark.has_timestamps(),
    };
}

function tell(sizes, text) {
    postMessage({ kind: "progress", share: done / workOf(sizes), text });
}
