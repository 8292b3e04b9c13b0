// Less to draw where drawing is slow: phones, and computers that draw without a GPU.

/** Milliseconds between frames above which the picture does not look fluent. */
const SLOW_FRAME_MS = 50;
const SLOW_FRAMES_PER_LEVEL = 8;

/** What is drawn at each level, from the best. */
export const LEVELS = [
    { hasShadows: true, maxPixelRatio: 2 },
    { hasShadows: false, maxPixelRatio: 1 },
    { hasShadows: false, maxPixelRatio: 0.5 },
];

/** Goes down a level after some slow frames in a row. It never goes up, so the picture does not flicker. */
export class Quality {
    #level = 0;
    #slowFrames = 0;
    #last;

    /** Returns the present level. */
    get level() {
        return LEVELS[this.#level];
    }

    /** Notes that a frame is drawn at this time, in milliseconds. Returns true if the level changes. */
    noteFrame(now) {
        const isSlow = now - (this.#last ?? now) > SLOW_FRAME_MS;
        this.#last = now;
        this.#slowFrames = isSlow ? this.#slowFrames + 1 : 0;
        if (this.#slowFrames < SLOW_FRAMES_PER_LEVEL || this.#level === LEVELS.length - 1) return false;
        this.#level += 1;
        this.#slowFrames = 0;
        return true;
    }
}
