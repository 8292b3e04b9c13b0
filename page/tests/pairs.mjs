// The broad phase's pairs, step by step, for comparisons.

import { execFileSync } from "node:child_process";

/** Steps that are compared. */
export const PAIR_STEPS = 60;

/** Returns the pairs after each step that a native program prints: indices of colliders, pair after pair. */
export function nativePairs(program, { scene, bodies, seed, broadPhase }) {
    const output = execFileSync(program, [scene, bodies, seed, PAIR_STEPS, broadPhase], { maxBuffer: 2 ** 30 });
    return output.toString().trim().split("\n").map((line) => JSON.parse(line));
}

/** Returns the first step, from 1, in which two runs have other pairs; undefined if all are equal. */
export function firstDifference(one, other) {
    const step = one.findIndex((pairs, at) => pairs.join() !== other[at]?.join());
    return step < 0 ? undefined : step + 1;
}
