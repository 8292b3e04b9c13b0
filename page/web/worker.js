// Steps the world apart from the page, which stays responsive while a step takes long.

import { connect } from "./device.js";
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
        await prepare(settings.broadPhase);
        simulation?.free();
        simulation = create(settings);
        broadPhase = settings.broadPhase;
        return { ...readScenery(), ...readFrame() };
    },

    async step() {
        const isNewScenery = await advance(simulation, broadPhase);
        return { ...(isNewScenery && readScenery()), ...readFrame() };
    },

    async changeBroadPhase(name) {
        await prepare(name);
        simulation.change_broad_phase(name);
        broadPhase = name;
    },

    async pairs(settings, steps) {
        await prepare(settings.broadPhase);
        const [apart, pairs] = [create(settings), []];
        for (let step = 0; step < steps; step++) {
            await advance(apart, settings.broadPhase);
            pairs.push(apart.pairs());
        }
        return pairs;
    },
};

/** Opens the GPU where it is needed. Its module is loaded only then. */
async function prepare(name) {
    if (name !== "gpu" || findOnGpu) return;
    const { openGpu } = await import("./gpu.js");
    findOnGpu = await openGpu();
}

async function advance(world, name) {
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
