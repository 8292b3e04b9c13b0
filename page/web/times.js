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
    #byBroadPhase = Object.fromEntries(BROAD_PHASES.map((name) => [name, []]));

    /** Adds a step, and drops those that left the window. */
    add(entry) {
        const list = this.#byBroadPhase[entry.broadPhase];
        list.push(entry);
        if (list.length > WINDOW_STEPS) list.shift();
    }

    /** Returns the `mean` or `p99` of a time over the last steps with a broad phase; NaN without any. */
    figure(broadPhase, time, figure) {
        return FIGURES[figure](this.#byBroadPhase[broadPhase].map(({ times }) => times[time]));
    }

    /** Returns the columns of a chart: the numbers of the last steps, and a time with each broad phase, null where it did not run. */
    columns(time) {
        const lists = Object.values(this.#byBroadPhase);
        const numbers = lists.flat().map(({ steps }) => steps).sort((a, b) => a - b);
        const shown = [...new Set(numbers)].slice(-WINDOW_STEPS);
        const column = (list) => {
            const byStep = new Map(list.map(({ steps, times }) => [steps, times[time]]));
            return shown.map((step) => byStep.get(step) ?? null);
        };
        return [shown, ...lists.map(column)];
    }
}

/** Returns milliseconds with two or three significant digits; a dash without a number. */
export function formatMs(ms) {
    if (Number.isNaN(ms)) return "–";
    return ms < 10 ? ms.toFixed(2) : ms.toFixed(1);
}
