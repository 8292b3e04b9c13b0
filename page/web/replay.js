// The same fall with each broad phase, so that the times are of the same steps.

import { BROAD_PHASES } from "./settings.js";
import { formatMs, WINDOW_STEPS } from "./times.js";

/** Steps of each broad phase: those that the table shows. */
export const REPLAY_STEPS = WINDOW_STEPS;
/** Steps before a replay, after which the browser has compiled the code of each broad phase well. */
export const WARM_UP_STEPS = 30;
const WARM_UP_BODIES = 500;

/** Returns the settings of a warm-up with a broad phase. */
export function warmUpSettings(settings, broadPhase) {
    return { ...settings, broadPhase, bodies: Math.min(settings.bodies, WARM_UP_BODIES) };
}

/** Returns the broad phases to show: all, or all but the GPU if something is in its way. */
export function replayable(gpuObstacle) {
    return BROAD_PHASES.filter((name) => name !== "gpu" || !gpuObstacle);
}

/** Returns sentences that say which broad phase was faster, from the times of the same steps. */
export function verdict(times) {
    const mean = (name) => times.figure(name, "broadPhase", "mean");
    const [stock, pbig, gpu] = BROAD_PHASES.map(mean);
    const sentences = [compare(["stock", stock], ["pbig", pbig])];
    if (!Number.isNaN(gpu)) sentences.push(compare(["the CPU", pbig], ["the GPU", gpu]));
    return `Means of the broad phase over the same ${REPLAY_STEPS} steps, on this machine: ${sentences.join("; ")}.`;
}

function compare(...both) {
    const [[fast, less], [slow, more]] = both.sort(([, a], [, b]) => a - b);
    const [least, most] = [less, more].map(formatMs);
    if (least === most) return `${fast} and ${slow} both took ${least} ms`;
    return `${fast} was faster than ${slow}, ${least} ms instead of ${most}`;
}
