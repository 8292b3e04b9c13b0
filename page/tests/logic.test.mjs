// The parts of the page that need no browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Pace, STEP_MS } from "../web/pace.js";
import { LEVELS, Quality } from "../web/quality.js";
import { replayable, verdict, warmUpSettings } from "../web/replay.js";
import { findMissing, hasModuleWorkers } from "../web/requirements.js";
import { bodyChoices, formatSettings, parseSettings } from "../web/settings.js";
import { Simulation, SimulationEnded } from "../web/simulation.js";
import { findAdapter, gpuObstacle } from "../web/webgpu.js";
import { formatMs, mean, p99, Times, WINDOW_STEPS } from "../web/times.js";

test("mean and p99 by hand", () => {
    const hundred = Array.from({ length: 100 }, (_, at) => 100 - at);
    assert.equal(mean([1, 2, 6]), 3);
    assert.equal(p99(hundred), 99);
    assert.equal(p99([5]), 5);
    assert.equal(p99([...hundred, 1000]), 100);
    assert.deepEqual([mean([]), p99([])], [NaN, NaN]);
});

test("times keep the last steps of each broad phase", () => {
    const times = new Times();
    const add = (steps, broadPhase, ms) => times.add({ steps, broadPhase, times: { broadPhase: ms, step: 2 * ms } });
    add(1, "stock", 4);
    for (let step = 2; step <= WINDOW_STEPS + 10; step++) add(step, "pbig", step < 11 ? 100 : 1);
    assert.equal(times.figure("stock", "step", "mean"), 8);
    assert.equal(times.figure("pbig", "broadPhase", "p99"), 1);
    const [steps, stock, pbig, gpu] = times.columns("step");
    assert.deepEqual([steps.length, steps[0], stock[0], pbig[0], gpu[0]], [WINDOW_STEPS, 11, null, 2, null]);
    assert.ok(Number.isNaN(new Times().figure("pbig", "step", "mean")));
});

test("times have two or three significant digits", () => {
    assert.deepEqual([0.123, 1.234, 12.345, NaN].map(formatMs), ["0.12", "1.23", "12.3", "–"]);
});

test("steps keep to real time on any screen", () => {
    for (const hertz of [30, 60, 90, 144]) {
        const pace = new Pace();
        const frames = Array.from({ length: 10 * hertz }, (_, at) => (at * 1000) / hertz);
        const steps = frames.filter((now) => pace.takeStep(now)).length;
        assert.ok(Math.abs(steps - 10 * Math.min(hertz, 60)) <= 2, `${steps} steps in 10 s at ${hertz} Hz`);
    }
});

test("time lost in a pause is not caught up", () => {
    const pace = new Pace();
    assert.ok(pace.takeStep(0) && pace.takeStep(5000));
    assert.ok(!pace.takeStep(5001) && pace.takeStep(5000 + STEP_MS));
});

test("slow frames in a row lower the quality, single ones do not", () => {
    const quality = new Quality();
    let now = 0;
    const draw = (ms, frames) => Array.from({ length: frames }, () => quality.noteFrame((now += ms))).filter(Boolean).length;
    assert.equal(draw(16, 100), 0);
    for (let i = 0; i < 20; i++) assert.equal(draw(200, 3) + draw(16, 1), 0);
    assert.equal(draw(200, 8), 1);
    assert.equal(quality.level, LEVELS[1]);
    assert.equal(draw(200, 100), 1);
    assert.equal(quality.level, LEVELS.at(-1));
});

test("an address gives settings, and settings an address", () => {
    const settings = { scene: "pile", bodies: 123, seed: 7, broadPhase: "stock" };
    assert.deepEqual(parseSettings(formatSettings(settings), false), settings);
    assert.equal(parseSettings("", false).bodies, 2000);
    assert.equal(parseSettings("", true).bodies, 1000);
    assert.deepEqual(bodyChoices(300).slice(0, 3), [100, 300, 500]);
});

test("wrong addresses are refused with the right values", () => {
    for (const query of ["?bodies=0", "?bodies=1e9", "?bodies=1.5", "?seed=-1", "?seed=x"]) {
        assert.throws(() => parseSettings(query, false), /must be from/, query);
    }
    assert.throws(() => parseSettings("?broad-phase=grid", false), /'grid'.*stock, pbig, gpu/);
});

test("the first missing requirement is named; a check that throws counts as missing", async () => {
    const there = { name: "there", isThere: async () => true };
    const absent = { name: "absent", isThere: async () => false };
    const broken = { name: "broken", isThere: async () => Promise.reject(new Error("no")) };
    assert.equal(await findMissing([there]), undefined);
    assert.equal((await findMissing([there, absent, broken])).name, "absent");
    assert.equal((await findMissing([there, broken])).name, "broken");
});

test("a worker that does not read its type cannot be a module", () => {
    class Classic {
        terminate() {}
    }
    class Modern extends Classic {
        constructor(url, { type }) {
            super();
            this.type = type;
        }
    }
    assert.deepEqual([Modern, Classic].map(hasModuleWorkers), [true, false]);
});

test("the end of a simulation is not a failure of its calls", async () => {
    let worker;
    globalThis.Worker = class {
        constructor() {
            worker = this;
        }
        postMessage() {}
        terminate() {}
    };
    const simulation = new Simulation();
    const [broken, ended] = [simulation.step(), simulation.build({})];
    worker.onmessage({ data: { id: 1, error: "no such scene" } });
    simulation.end();
    await assert.rejects(broken, (error) => !(error instanceof SimulationEnded) && error.message === "no such scene");
    await assert.rejects(ended, SimulationEnded);
});

test("a replay shows what works, and its verdict names the faster one", () => {
    assert.deepEqual([replayable(), replayable("no WebGPU")], [["stock", "pbig", "gpu"], ["stock", "pbig"]]);
    assert.deepEqual(warmUpSettings({ scene: "pile", bodies: 5000 }, "gpu"), { scene: "pile", bodies: 500, broadPhase: "gpu" });
    const times = new Times();
    const add = (broadPhase, ms) => times.add({ steps: 1, broadPhase, times: { broadPhase: ms, step: 9 } });
    add("stock", 4);
    add("pbig", 2);
    assert.match(verdict(times), /same 300 steps, on this machine: pbig was faster than stock, 2.00 ms instead of 4.00\.$/);
    add("gpu", 1);
    assert.match(verdict(times), /; the GPU was faster than the CPU, 1.00 ms instead of 2.00\.$/);
    add("gpu", 3.002);
    assert.match(verdict(times), /; the CPU and the GPU both took 2.00 ms\.$/);
    add("stock", 0.1);
    add("pbig", 9);
    assert.match(verdict(times), /: stock was faster than pbig, 2.05 ms instead of 5.50; the GPU was faster than the CPU/);
});

test("times of the same steps stand side by side", () => {
    const times = new Times();
    for (const [broadPhase, ms] of [["stock", 3], ["pbig", 1]]) {
        for (const steps of [1, 2]) times.add({ steps, broadPhase, times: { broadPhase: ms, step: ms } });
    }
    assert.deepEqual(times.columns("step"), [[1, 2], [3, 3], [1, 1], [null, null]]);
});

test("a browser without WebGPU is told why", async () => {
    const without = { requestAdapter: async () => null };
    await assert.rejects(findAdapter(undefined, false), /https, or localhost/);
    await assert.rejects(findAdapter(undefined, true), /no WebGPU: Chrome/);
    await assert.rejects(findAdapter(without, true), /no WebGPU: it finds no GPU/);
    assert.match(await gpuObstacle(undefined, false), /https/);
    const adapter = {};
    assert.equal(await findAdapter({ requestAdapter: async () => adapter }, true), adapter);
});

test("a search without pairs is the CPU's, once", async () => {
    // What it returns in a browser can be called by a module alone.
    WebAssembly.Suspending = function (suspended) {
        return suspended;
    };
    const { connect, find_pairs, take_pairs, takeDeclined, takeFailure } = await import("../web/device.js");
    const answers = [[0, 1], undefined, new Error("planted")];
    const found = [];
    connect({ buffer: new ArrayBuffer(48) }, async () => {
        const answer = answers.shift();
        if (answer instanceof Error) throw answer;
        return answer;
    });
    while (answers.length > 0) {
        await find_pairs(0, 0, 2);
        found.push([take_pairs(), takeDeclined(), takeDeclined(), takeFailure()?.message]);
    }
    assert.deepEqual(found, [[[0, 1], false, false, undefined], [undefined, true, false, undefined], [undefined, true, false, "planted"]]);
});
