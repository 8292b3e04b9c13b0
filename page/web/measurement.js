// What is measured on a GPU, and how it is told: no page and no GPU is needed here.

/** The set of boxes, as `pbig bench gpu` names it. */
export const SET = "uniform";
/** Numbers of boxes. */
export const SIZES = [10_000, 100_000, 1_000_000];

/** What the table says of pairs that differ from the CPU's. */
export const DIFFERENT = "NO";

const MAX_BOXES_OF_MANY_ROUNDS = 100_000;
const ROUNDS = { few: 4, many: 7 };
/** Rounds whose kernels are timed, after the others: timing makes a call slower. */
export const KERNEL_ROUNDS = 2;
// The first columns are those of the searches of `pbig bench gpu` without `steady_ms` and the prediction, the next ones those of its table of the host's part.
const COLUMNS = [
    ["set", "boxes", "pairs", "cpu_ms", "gpu_ms", "cpu_over_gpu", "wait_ms", "uploaded_bytes", "downloaded_bytes"],
    ["device_bytes", "upload_ms", "plan_ms", "record_ms", "decode_ms", "pairs_equal"],
].flat();

/** Returns the number of rounds with so many boxes. The first one compiles and allocates, and does not count. */
export function roundsOf(boxes) {
    return boxes > MAX_BOXES_OF_MANY_ROUNDS ? ROUNDS.few : ROUNDS.many;
}

/** Returns the work of measuring these numbers of boxes, in boxes. */
export function workOf(sizes) {
    return sizes.reduce((sum, boxes) => sum + boxes * (roundsOf(boxes) + KERNEL_ROUNDS), 0);
}

/** Returns the median; NaN of none. */
export function median(numbers) {
    const sorted = [...numbers].sort((a, b) => a - b);
    const half = sorted.length >> 1;
    return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

/** Returns the row of a number of boxes, from the times and the report of each round that counts. */
export function rowOf({ boxes, pairs, rounds, kernels, isEqual }) {
    const medianOf = (name) => median(rounds.map((round) => round[name]));
    const { uploaded_bytes, downloaded_bytes, device_bytes } = rounds.at(-1);
    const times = ["cpu_ms", "gpu_ms", "wait_ms", "upload_ms", "plan_ms", "record_ms", "decode_ms"];
    const row = Object.fromEntries(times.map((name) => [name, medianOf(name)]));
    const bytes = { uploaded_bytes, downloaded_bytes, device_bytes };
    const pairs_equal = isEqual ? "yes" : DIFFERENT;
    return { set: SET, boxes, pairs, ...row, cpu_over_gpu: row.cpu_ms / row.gpu_ms, ...bytes, pairs_equal, kernels };
}

/** Returns CSV as `pbig bench gpu` writes it: the conditions in lines that begin with `#`, then a row for each number of boxes. */
export function csvOf(conditions, rows) {
    const kernels = [...new Set(rows.flatMap((row) => Object.keys(row.kernels)))];
    const head = Object.entries(conditions).map(([name, value]) => `# ${name}: ${value}`);
    const columns = [...COLUMNS, ...kernels.map((kernel) => `${kernel}_ms`)].join();
    const cells = (row) => [...COLUMNS.map((column) => row[column]), ...kernels.map((kernel) => row.kernels[kernel])];
    return [...head, columns, ...rows.map((row) => cells(row).map(formatCell).join())].join("\n") + "\n";
}

// Counts are exact, times have five digits.
function formatCell(value = "") {
    return typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(5))) : String(value);
}

/** Returns the sum of the kernels' times of a row; NaN if they were not timed. */
export function kernelsMs({ kernels }) {
    const times = Object.values(kernels);
    return times.length ? times.reduce((sum, ms) => sum + ms) : NaN;
}
