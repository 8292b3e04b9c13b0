// The GPU for the simulation's module, which imports `find_pairs` and `take_pairs`.

let memory;
let search;
let pairs;
let failure;
let hasDeclined = false;

/** Sets the memory of the simulation's module, and the function that returns a promise of the pairs of boxes and filters. */
export function connect(moduleMemory, searchFunction) {
    [memory, search] = [moduleMemory, searchFunction];
}

async function find(boxes, filters, count) {
    const copy = (Type, at, numbers) => new Type(memory.buffer, at, numbers * count).slice();
    pairs = undefined;
    try {
        pairs = await search(copy(Float32Array, boxes, 6), filters ? copy(Uint32Array, filters, 4) : undefined);
    } catch (error) {
        // The CPU does the work, as if the GPU had declined it.
        failure = error;
    }
}

/** Suspends the calling module until the GPU has answered. */
export const find_pairs = globalThis.WebAssembly?.Suspending ? new WebAssembly.Suspending(find) : () => {};

/** Returns the pairs that were found last: ids, pair after pair. Nothing if the GPU declined, or failed. */
export function take_pairs() {
    hasDeclined ||= !pairs;
    return pairs;
}

/** Returns true if the GPU declined a search since the last call, or failed: the CPU did the work. */
export function takeDeclined() {
    const taken = hasDeclined;
    hasDeclined = false;
    return taken;
}

/** Returns the error of a search since the last call, if there was one. */
export function takeFailure() {
    const taken = failure;
    failure = undefined;
    return taken;
}
