// Runs the corpus and a rapier world in a WebAssembly module: node wasm/run.mjs MODULE
import { readFile } from "node:fs/promises";

const module = await WebAssembly.compile(await readFile(process.argv[2]));
const imports = WebAssembly.Module.imports(module);
if (imports.length > 0) {
    // A page without a binding generator could not load such a module.
    fail(`the module imports ${imports.map(({ module, name }) => `${module}.${name}`).join(", ")}`);
}
const { exports } = await WebAssembly.instantiate(module);

function fail(why) {
    console.log(`failed: ${why}`);
    process.exit(1);
}

function text() {
    const bytes = new Uint8Array(exports.memory.buffer, exports.text_address(), exports.text_length());
    return new TextDecoder().decode(bytes);
}

// A panic ends in a trap; the module keeps its message.
function call(name) {
    try {
        return exports[name]();
    } catch (trap) {
        return fail(`${name}: ${text() || "no message"} (${trap})`);
    }
}

call("keep_panics");
call("run");
console.log(text());
