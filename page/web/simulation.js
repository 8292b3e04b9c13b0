// The worker that steps the world, as an object with asynchronous methods.

/** The rejection of the calls that were under way when their simulation was ended. */
export class SimulationEnded extends Error {}

/** A worker whose answers are promises. Once one is rejected by a trap or by the worker itself, make a new one. */
export class Simulation {
    #worker;
    #waiting = new Map();
    #last = 0;

    constructor(url = "worker.js") {
        this.#worker = new Worker(url, { type: "module" });
        this.#worker.onmessage = ({ data }) => this.#settle(data);
        this.#worker.onerror = (event) => this.#failAll(new Error(event.message || `${url} could not be loaded`));
    }

    /** Loads the module, and returns the scenes: `{ name, about, hard }`. */
    load() {
        return this.#call("load");
    }

    /** Builds a scene from settings, and returns its shapes and its first frame. */
    build(settings) {
        return this.#call("build", settings);
    }

    /** Advances by one step, and returns the frame. Its `failure` says why the GPU failed; then the CPU goes on. Its `hasDeclined` is
     * true if the CPU did the GPU's work. */
    step() {
        return this.#call("step");
    }

    /** Changes the broad phase of the running world. Returns why the GPU could not be opened; then the CPU goes on. */
    changeBroadPhase(name) {
        return this.#call("changeBroadPhase", name);
    }

    /** Builds a scene of its own, and returns its pairs after each step: indices of colliders, pair after pair. */
    pairs(settings, steps) {
        return this.#call("pairs", settings, steps);
    }

    /** Ends the worker. */
    end() {
        this.#worker.terminate();
        this.#failAll(new SimulationEnded("the simulation was ended"));
    }

    #call(method, ...parameters) {
        const id = ++this.#last;
        this.#worker.postMessage({ id, method, parameters });
        return new Promise((resolve, reject) => this.#waiting.set(id, { resolve, reject }));
    }

    #settle({ id, result, error }) {
        const { resolve, reject } = this.#waiting.get(id);
        this.#waiting.delete(id);
        if (error === undefined) resolve(result);
        else reject(new Error(error));
    }

    #failAll(error) {
        for (const { reject } of this.#waiting.values()) reject(error);
        this.#waiting.clear();
    }
}
