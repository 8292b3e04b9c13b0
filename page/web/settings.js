// The scene that the page shows. The address has it, so that a link shows the same.

export const BODY_COUNTS = [100, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000];
export const BROAD_PHASES = ["stock", "pbig", "gpu"];
const MAX_BODIES = 100_000;
const MAX_SEED = 0xffffffff;

const DEFAULTS = { scene: "column", bodies: 2000, seed: 1, broadPhase: "pbig" };
// Phones have narrow screens, and slower processors.
const BODIES_ON_NARROW_SCREENS = 1000;

/** Returns the settings in the query of an address, such as `?scene=pile&bodies=500`. Throws an Error that names a wrong one. */
export function parseSettings(query, isNarrow) {
    const defaults = isNarrow ? { ...DEFAULTS, bodies: BODIES_ON_NARROW_SCREENS } : DEFAULTS;
    const given = new URLSearchParams(query);
    const text = (name, otherwise) => given.get(name) ?? otherwise;
    return {
        scene: text("scene", defaults.scene),
        bodies: parseCount("bodies", text("bodies", defaults.bodies), 1, MAX_BODIES),
        seed: parseCount("seed", text("seed", defaults.seed), 0, MAX_SEED),
        broadPhase: parseBroadPhase(text("broad-phase", defaults.broadPhase)),
    };
}

/** Returns the query that `parseSettings` reads these settings from. */
export function formatSettings({ scene, bodies, seed, broadPhase }) {
    return `?${new URLSearchParams({ scene, bodies, seed, "broad-phase": broadPhase })}`;
}

/** Returns the numbers of bodies to choose from: the usual ones, and this one. */
export function bodyChoices(bodies) {
    return [...new Set([...BODY_COUNTS, bodies])].sort((a, b) => a - b);
}

function parseCount(name, text, min, max) {
    const count = Number(text);
    if (Number.isInteger(count) && count >= min && count <= max) return count;
    throw new Error(`'${text}' in the address is no number of ${name}: it must be from ${min} to ${max}.`);
}

function parseBroadPhase(name) {
    if (BROAD_PHASES.includes(name)) return name;
    throw new Error(`'${name}' in the address is no broad phase: it must be one of ${BROAD_PHASES.join(", ")}.`);
}
