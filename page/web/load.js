// WebAssembly modules.

/** Loads a module by the `init` of its bindings, and returns its exports. */
export async function loadModule(init, file) {
    const response = await fetch(file);
    if (!response.ok) throw new Error(`${file} could not be loaded: status ${response.status}`);
    return init({ module_or_path: await response.arrayBuffer() });
}

/** Returns the text of an error. A trap has no words of its own: the module keeps those of the panic. */
export function describe(error, panicMessage) {
    const isTrap = globalThis.WebAssembly && error instanceof WebAssembly.RuntimeError;
    return (isTrap && panicMessage()) || error.message || String(error);
}
