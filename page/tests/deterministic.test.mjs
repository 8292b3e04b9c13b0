// With rapier's deterministic mathematics, which are the same everywhere, each scene has the pairs of the native build.
// Environment: DETERMINISTIC, a folder with the module, its bindings and the native program.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import { before, test } from "node:test";
import { firstDifference, nativePairs, PAIR_STEPS } from "./pairs.mjs";

const folder = process.env.DETERMINISTIC;
let module;

before(async () => {
    if (!folder) return;
    module = await import(pathToFileURL(`${folder}/pbig_page.mjs`));
    module.initSync({ module: await readFile(`${folder}/pbig_page_bg.wasm`) });
});

function modulePairs({ scene, bodies, seed, broadPhase }) {
    const simulation = new module.Simulation(scene, bodies, seed, broadPhase);
    return Array.from({ length: PAIR_STEPS }, () => {
        simulation.advance();
        simulation.end_step();
        return Array.from(simulation.pairs());
    });
}

test("each scene has the pairs of the native build", { skip: !folder && "DETERMINISTIC is not set" }, () => {
    const differences = {};
    for (const { name } of module.scenes()) {
        const settings = { scene: name, bodies: 500, seed: 1, broadPhase: "pbig" };
        const native = nativePairs(`${folder}/native_pairs`, settings);
        const step = firstDifference(modulePairs(settings), native);
        if (step !== undefined) differences[name] = step;
    }
    assert.deepEqual(differences, {}, "scenes, and the first step that differs");
});
