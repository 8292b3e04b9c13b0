// The times of the last steps, for each broad phase.

import { BROAD_PHASES } from "./settings.js";

/** Steps that means, p99s and charts show. */
export const WINDOW_STEPS = 300;

/** Returns the mean of some numbers; NaN of none. */
export function mean(numbers) {
    return numbers.reduce((sum, number) => sum + number, 0) / numbers.length;
}

/** Returns the smallest number that at least 99% of the numbers do not exceed; NaN of none. */
export function p99(numbers) {
    const sorted = [...numbers].sort((a, b) => a - b);
    return sorted[Math.ceil(sorted.length * 0.99) - 1] ?? NaN;
}

const FIGURES = { mean, p99 };

/** The last steps: `{ steps, broadPhase, times: { broadPhase, step } }`, times in milliseconds. */
export class Times {
    #all = [];
    #byBroadPhase = Object.fromEntries(BROAD_PHASES.map((name) => [name, []]));

    /** Adds a step, and drops those that left the window. */
    add(entry) {
        for (const list of [this.#all, this.#byBroadPhase[entry.broadPhase]]) {
            list.push(entry);
            if (list.length > WINDOW_STEPS) list.shift();
        }
    }

    /** Returns the `mean` or `p99` of a time over the last steps with a broad phase; NaN without any. */
    figure(broadPhase, time, figure) {
        return FIGURES[figure](this.#byBroadPhase[broadPhase].map(({ times }) => times[time]));
    }

    /** Returns the columns of a chart: numbers of steps, and a time with each broad phase, null where another one ran. */
    columns(time) {
        const of = (name) =>
            this.#all.map(({ broadPhase, times }) => (broadPhase === name ? times[time] : null));
        return [this.#all.map(({ steps }) => steps), ...BROAD_PHASES.map(of)];
    }
}

/** Returns milliseconds with two or three significant digits; a dash without a number. */
export function formatMs(ms) {
    if (Number.isNaN(ms)) return "–";
    return ms < 10 ? ms.toFixed(2) : ms.toFixed(1);
}
