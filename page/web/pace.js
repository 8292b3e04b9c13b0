// Steps of 1/60 s at the speed of the real time, at every refresh rate of the screen.

export const STEP_MS = 1000 / 60;
// Frames of a screen of 60 Hz come a little early or late.
const TOLERANCE_MS = 2;

/** Decides whether a step is due. A world too slow for real time runs in slow motion. */
export class Pace {
    #due = -Infinity;

    /** Returns true if a step is due at this time, in milliseconds, and notes that it is taken. */
    takeStep(now) {
        if (now < this.#due - TOLERANCE_MS) return false;
        // Time lost by more than a step, as in a pause, is not caught up.
        const isLate = now - this.#due > STEP_MS;
        this.#due = (isLate ? now : this.#due) + STEP_MS;
        return true;
    }
}
