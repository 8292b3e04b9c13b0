// The dialog that measures the GPU and shows the table.

import { csvOf, DIFFERENT, kernelsMs, SIZES } from "./measurement.js";
import { formatMs } from "./times.js";

const WORKER = "measure-worker.js";
const element = (id) => document.getElementById(`measure-${id}`);
const formatCount = (count) => count.toLocaleString("en");

// The rows of the table: a label, and what it says of a number of boxes.
const FIGURES = [
    ["Pairs", ({ pairs }) => formatCount(pairs)],
    ["Pairs equal", ({ pairs_equal }) => pairs_equal],
    ["CPU, ms", ({ cpu_ms }) => formatMs(cpu_ms)],
    ["GPU, ms", ({ gpu_ms }) => formatMs(gpu_ms)],
    ["CPU / GPU", ({ cpu_over_gpu }) => `${cpu_over_gpu.toPrecision(2)} ×`],
    ["Upload", ({ upload_ms }) => formatMs(upload_ms), "part"],
    ["Record", ({ plan_ms, record_ms }) => formatMs(plan_ms + record_ms), "part"],
    ["Wait", ({ wait_ms }) => formatMs(wait_ms), "part"],
    ["Decode", ({ decode_ms }) => formatMs(decode_ms), "part"],
    ["Kernels", (row) => formatMs(kernelsMs(row)), "part"],
];

/** The measurement in a worker, and its dialog. Its parameter pauses the simulation, and lets it go on. */
export class Measure {
    /** Numbers of boxes to measure. */
    sizes = SIZES;
    #pause;
    #worker;
    #conditions;
    #rows;

    constructor(pause) {
        this.#pause = pause;
        element("open").onclick = () => this.#open();
        element("cancel").onclick = () => this.#end("Cancelled.");
        element("copy").onclick = () => this.#copy();
        element("download").onclick = () => this.#download();
        element("close").onclick = () => element("dialog").close();
        element("dialog").onclose = () => this.#leave();
    }

    #open() {
        this.#pause(true);
        [this.#conditions, this.#rows] = [{}, []];
        element("device").textContent = "";
        this.#showRows();
        this.#showProgress(0, "Loading…");
        this.#showRunning(true);
        element("dialog").showModal();
        this.#start();
    }

    #start() {
        this.#worker = new Worker(WORKER, { type: "module" });
        this.#worker.onmessage = ({ data }) => this.#receive(data);
        this.#worker.onerror = ({ message }) => this.#fail(message || `${WORKER} could not be loaded`);
        this.#worker.postMessage({ sizes: this.sizes });
    }

    #receive({ kind, ...told }) {
        if (kind === "progress") this.#showProgress(told.share, told.text);
        else if (kind === "device") this.#showDevice(told.conditions);
        else if (kind === "row") this.#addRow(told.row);
        else if (kind === "failure") this.#fail(told.text);
        else this.#end("Done.");
    }

    #showDevice(conditions) {
        this.#conditions = conditions;
        const software = conditions.software ? " A program on the CPU stands in for a GPU: the times say nothing." : "";
        element("device").textContent = `${conditions.adapter}.${software}`;
    }

    #addRow(row) {
        this.#rows.push(row);
        this.#showRows();
    }

    #showProgress(share, text) {
        element("progress").value = share;
        element("state").textContent = text;
    }

    #showRunning(isRunning) {
        element("state").className = "";
        for (const [name, isShown] of Object.entries({ cancel: isRunning, progress: isRunning, close: !isRunning })) {
            element(name).hidden = !isShown;
        }
        for (const name of ["copy", "download"]) element(name).hidden = isRunning || this.#rows.length === 0;
    }

    #showRows() {
        const [head, body] = [element("table").tHead, element("table").tBodies[0]];
        element("table").hidden = this.#rows.length === 0;
        const sizes = this.#rows.map(({ boxes }) => cell("th", formatCount(boxes), { scope: "col" }));
        head.rows[0].replaceChildren(cell("td", "Boxes"), ...sizes);
        body.replaceChildren(...FIGURES.map((figure) => this.#figureRow(figure)));
    }

    #figureRow([label, textOf, className = ""]) {
        const row = document.createElement("tr");
        row.className = className;
        const cells = this.#rows.map((it) => cell("td", textOf(it), { className: textOf(it) === DIFFERENT ? "wrong" : "" }));
        row.append(cell("th", label, { scope: "row" }), ...cells);
        return row;
    }

    #fail(text) {
        this.#end(text);
        element("state").className = "failure";
    }

    #end(text) {
        this.#drop();
        this.#showRunning(false);
        element("state").textContent = text;
    }

    #drop() {
        this.#worker?.terminate();
        this.#worker = undefined;
    }

    // The event of a close may come after the dialog is open again.
    #leave() {
        if (element("dialog").open) return;
        this.#drop();
        this.#pause(false);
    }

    async #copy() {
        const copied = navigator.clipboard.writeText(this.#csv());
        const answer = await copied.then(() => "Copied.", () => "The browser does not allow to copy: download it instead.");
        element("state").textContent = answer;
    }

    #download() {
        const link = document.createElement("a");
        link.href = URL.createObjectURL(new Blob([this.#csv()], { type: "text/csv" }));
        link.download = "pbig-gpu.csv";
        link.click();
        URL.revokeObjectURL(link.href);
    }

    #csv() {
        return csvOf({ day: new Date().toISOString().slice(0, 10), ...this.#conditions }, this.#rows);
    }
}

function cell(tag, textContent, properties = {}) {
    return Object.assign(document.createElement(tag), { textContent, ...properties });
}
