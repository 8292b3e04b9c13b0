// Steps the world apart from the page, which stays responsive while a step takes long.

import init, { Simulation, panic_message, scenes } from "pbig-page-module";

const MODULE = "pbig_page_bg.wasm";
let simulation;
// The broad phase in use.
let broadPhase;

const methods = {
    async load() {
        const response = await fetch(MODULE);
        if (!response.ok) throw new Error(`${MODULE} could not be loaded: status ${response.status}`);
        await init({ module_or_path: await response.arrayBuffer() });
        return scenes().map(({ name, about, hard }) => ({ name, about, hard }));
    },

    build(settings) {
        simulation?.free();
        simulation = create(settings);
        broadPhase = settings.broadPhase;
        return { ...readScenery(), ...readFrame() };
    },

    step() {
        const isNewScenery = simulation.step();
        return { ...(isNewScenery && readScenery()), ...readFrame() };
    },

    changeBroadPhase(name) {
        simulation.change_broad_phase(name);
        broadPhase = name;
    },

    pairs(settings, steps) {
        const apart = create(settings);
        return Array.from({ length: steps }, () => {
            apart.step();
            return apart.pairs();
        });
    },
};

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

// A trap has no words of its own: the module keeps those of the panic.
function describe(error) {
    const isTrap = globalThis.WebAssembly && error instanceof WebAssembly.RuntimeError;
    return (isTrap && panic_message()) || error.message || String(error);
}

onmessage = async ({ data: { id, method, parameters } }) => {
    try {
        const result = await methods[method](...parameters);
        postMessage({ id, result }, result?.matrices ? [result.matrices.buffer] : []);
    } catch (error) {
        postMessage({ id, error: describe(error) });
    }
};
