// Runs the module's sets with the kernels as they are, and with workgroups and lanes in other orders: a result that depends on
// the order in which a GPU runs them would differ. Faults and limits of devices are tested natively, in tests/suite/gpu.

// Puts a new order into a kernel's text: `group` and `lane` become functions of those that the device gives.
function reordered(text, groupOf, laneOf) {
    const size = /@workgroup_size\((\w+)\)/.exec(text)[1];
    const head = /@compute[^]*?fn (\w+)\(([^]*?)\) *\{/.exec(text);
    const [group, groups, lane] = ["workgroup_id", "num_workgroups", "local_invocation_index"].map(
        (builtin) => new RegExp(`@builtin\\(${builtin}\\) (\\w+)`).exec(head[2])?.[1],
    );
    let [parameters, body] = [head[2], ""];
    if (group) {
        parameters = parameters.replace(`(workgroup_id) ${group}`, "(workgroup_id) given_group");
        if (!groups) parameters += ", @builtin(num_workgroups) all_groups: vec3<u32>";
        body += `let given_groups = ${groups ?? "all_groups"}; let ${group} = vec3(${groupOf("given_group.x", "given_groups.x")}, ${groupOf("given_group.y", "given_groups.y")}, 0u);`;
    }
    if (lane) {
        parameters = parameters.replace(`(local_invocation_index) ${lane}`, "(local_invocation_index) given_lane");
        body += `let ${lane} = ${laneOf("given_lane", `u32(${size})`)};`;
    }
    return text.replace(head[0], head[0].replace(head[2], parameters) + body);
}

const orders = {
    "as they are": (text) => text,
    reversed: (text) => reordered(text, (i, n) => `${n} - 1u - ${i}`, (i, n) => `${n} - 1u - ${i}`),
    // Both factors are odd primes, so each is a permutation: of up to 40,961 workgroups in a row, and of a power of two of lanes.
    scattered: (text) => reordered(text, (i, n) => `(${i} * 40961u + 7u) % ${n}`, (i, n) => `(${i} * 37u + 11u) % ${n}`),
};

// Faults that the comparison has to notice: an owner of pairs that owns all, and a comparison that excludes equal coordinates.
const faults = {
    "no owner": (text) => text.replace("return ((a | b) >> AXIS_BITS) == 7u;", "return true;"),
    "half-open boxes": (text) => text.replace("a.low[0] <= b.high[0]", "a.low[0] < b.high[0]"),
};

// Calls `work` while kernels are compiled from other texts.
async function withTexts(change, work) {
    const prototype = GPUDevice.prototype;
    const create = prototype.createShaderModule;
    prototype.createShaderModule = function (descriptor) {
        return create.call(this, { ...descriptor, code: change(descriptor.code) });
    };
    try {
        return await work();
    } finally {
        prototype.createShaderModule = create;
    }
}

// Runs every mode on sets of at most this number of boxes, and tells a line for each.
async function runModes(module, mostBoxes, tell) {
    let failed = 0;
    for (const [i, mode] of module.modes().entries()) {
        const outcome = await module.run(i, mostBoxes);
        tell(`${outcome.adapter}, ${mode}: ${outcome.sets} sets, ${outcome.pairs} pairs, ${outcome.declined} declined, ${outcome.failed} failed ${outcome.first}`);
        failed += outcome.failed + (outcome.pairs > 0 && outcome.declined === 0 ? 0 : 1);
    }
    return failed;
}

// Returns true if all is as it should be. An error has the message of a panic, which ends the module.
export async function check(module, tell) {
    try {
        return await checkAll(module, tell);
    } catch (error) {
        throw new Error(`${error} ${module.panic_message()}`);
    }
}

// Other orders and faults run on fewer sets: a software adapter takes minutes.
async function checkAll(module, tell) {
    let isRight = true;
    for (const [order, change] of Object.entries(orders)) {
        tell(`workgroups and lanes ${order}`);
        const mostBoxes = order === "as they are" ? 2 ** 31 : 300;
        isRight = (await withTexts(change, () => runModes(module, mostBoxes, tell))) === 0 && isRight;
    }
    for (const [fault, change] of Object.entries(faults)) {
        const { failed } = await withTexts(change, () => module.run(0, 300));
        tell(`planted fault, ${fault}: ${failed} sets failed`);
        isRight &&= failed > 0;
    }
    const fault = await module.interrupt();
    tell(`a call that is given up, and another beside it: ${fault || "as they should be"}`);
    return isRight && fault === "";
}
