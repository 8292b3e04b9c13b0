// Steps the world apart from the page, which stays responsive while a step takes long.

import { connect, takeDeclined, takeFailure } from "./device.js";
import { describe, loadModule } from "./load.js";
import init, { Simulation, panic_message, scenes } from "pbig-page-module";

const MODULE = "pbig_page_bg.wasm";
let simulation;
// The broad phase in use.
let broadPhase;
// `Simulation.advance`, which the GPU may suspend.
let advanceSuspended;
// Returns a promise of the pairs of boxes.
let findOnGpu;

const methods = {
    async load() {
        const { memory, simulation_advance } = await loadModule(init, MODULE);
        connect(memory, (boxes, filters) => findOnGpu(boxes, filters));
        advanceSuspended = WebAssembly.promising?.(simulation_advance);
        return scenes().map(({ name, about, hard }) => ({ name, about, hard }));
    },

    async build(settings) {
        const failure = await openGpuFor(settings.broadPhase);
        broadPhase = failure ? "pbig" : settings.broadPhase;
        simulation?.free();
        simulation = create({ ...settings, broadPhase });
        return { ...readScenery(), ...readFrame(), failure };
    },

    async step() {
        const used = broadPhase;
        const isNewScenery = await advance(simulation, used);
        const failure = takeGpuFailure();
        if (failure) change("pbig");
        return { ...(isNewScenery && readScenery()), ...readFrame(), broadPhase: used, hasDeclined: takeDeclined(), failure };
    },

    /** Returns why the GPU could not be opened; then the broad phase is pbig's on the CPU. */
    async changeBroadPhase(name) {
        const failure = await openGpuFor(name);
        change(failure ? "pbig" : name);
        return failure;
    },

    async pairs(settings, steps) {
        failIf(await openGpuFor(settings.broadPhase));
        const [apart, pairs] = [create(settings), []];
        for (let step = 0; step < steps; step++) {
            await advance(apart, settings.broadPhase);
            failIf(takeGpuFailure());
            pairs.push(apart.pairs());
        }
        apart.free();
        return pairs;
    },
};

/** Opens the GPU where it is needed. Its module is loaded only then. Returns the reason if that fails. */
async function openGpuFor(name) {
    if (name !== "gpu" || findOnGpu) return undefined;
    try {
        const { openGpu } = await import("./gpu.js");
        findOnGpu = await openGpu();
    } catch (error) {
        return firstLine(error);
    }
}

/** Returns the first line of an error. The lines below it, in some browsers, say where in the module it came from. */
function firstLine(error) {
    return error.message.split("\n")[0];
}

function change(name) {
    simulation.change_broad_phase(name);
    broadPhase = name;
}

/** Returns why the GPU failed since the last call, if it did. It is opened again when it is chosen again. */
function takeGpuFailure() {
    const failure = takeFailure();
    if (failure) findOnGpu = undefined;
    return failure && firstLine(failure);
}

function failIf(reason) {
    if (reason) throw new Error(reason);
}

async function advance(world, name) {
    takeDeclined(); // It may be that of another world.
    if (name === "gpu") await advanceSuspended(world.__wbg_ptr);
    else world.advance();
    return world.end_step();
}

function create(settings) {
    return new Simulation(settings.scene, settings.bodies, settings.seed, settings.broadPhase);
}

/** Reads what stays the same from step to step. */
function readScenery() {
    const copyGroup = ({ kind, mesh, is_translucent, count }) => ({ kind, mesh, isTranslucent: is_translucent, count });
    const copyMesh = ({ coordinates, indices }) => ({ coordinates, indices });
    return {
        scenery: {
            groups: simulation.groups().map(copyGroup),
            meshes: simulation.meshes().map(copyMesh),
            colours: simulation.colours(),
            movingBox: simulation.moving_box(),
        },
    };
}

function readFrame() {
    return {
        matrices: simulation.matrices(),
        steps: simulation.steps(),
        bodies: simulation.body_count(),
        pairs: simulation.pair_count(),
        plan: simulation.plan(),
        broadPhase,
        times: { broadPhase: simulation.broad_phase_ms(), step: simulation.step_ms() },
    };
}

onmessage = async ({ data: { id, method, parameters } }) => {
    try {
        const result = await methods[method](...parameters);
        postMessage({ id, result }, result?.matrices ? [result.matrices.buffer] : []);
    } catch (error) {
        postMessage({ id, error: describe(error, panic_message) });
    }
};
