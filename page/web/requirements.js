// What a browser must have to run the page.

import WebGL from "three/addons/capabilities/WebGL.js";
import { simd } from "wasm-feature-detect";

const REQUIREMENTS = [
    {
        name: "WebAssembly",
        isThere: async () => typeof WebAssembly === "object",
        advice: "It may be switched off by a security setting, such as a lockdown mode.",
    },
    {
        name: "WebAssembly SIMD",
        isThere: simd,
        advice: "Browsers have it since Chrome 91, Firefox 89 and Safari 16.4.",
    },
    {
        name: "WebGL 2",
        isThere: async () => WebGL.isWebGL2Available(),
        advice: "It may be switched off with the browser's graphics acceleration.",
    },
    { name: "Web Workers", isThere: async () => typeof Worker === "function", advice: "" },
    {
        name: "module workers",
        isThere: async () => hasModuleWorkers(Worker),
        advice: "Browsers have them since Chrome 80, Firefox 114 and Safari 15.",
    },
];

/** Returns true if workers can be modules. A browser without such workers does not read the option that asks for one. */
export function hasModuleWorkers(WorkerClass) {
    let isRead = false;
    const options = {
        get type() {
            isRead = true;
            return "module";
        },
    };
    const empty = URL.createObjectURL(new Blob([], { type: "text/javascript" }));
    new WorkerClass(empty, options).terminate();
    URL.revokeObjectURL(empty);
    return isRead;
}

/** Returns the first requirement that the browser lacks, or undefined. */
export async function findMissing(requirements = REQUIREMENTS) {
    for (const requirement of requirements) {
        if (!(await isMet(requirement))) return requirement;
    }
    return undefined;
}

// A check that throws is a feature that is not there.
async function isMet({ isThere }) {
    try {
        return await isThere();
    } catch {
        return false;
    }
}
