// The controls and the figures beside the stage.

import { createChart } from "./charts.js";
import { bodyChoices, BROAD_PHASES } from "./settings.js";
import { formatMs } from "./times.js";

const element = (id) => document.getElementById(id);
const formatCount = (count) => count.toLocaleString("en");
// Charts and tables are redrawn this often: every step would only flicker.
const STEPS_PER_REDRAW = 6;

/** The panel. Its parameter has a function for each control. */
export class Panel {
    #scenes = [];
    #charts = {
        broadPhase: createChart(element("chart-broad-phase")),
        step: createChart(element("chart-step")),
    };

    constructor({ change, changeBroadPhase, pause, step, reset, replay }) {
        element("scene").onchange = ({ target }) => change({ scene: target.value });
        element("bodies").onchange = ({ target }) => change({ bodies: Number(target.value) });
        element("broad-phase").onchange = ({ target }) => changeBroadPhase(target.value);
        element("pause").onclick = pause;
        element("step").onclick = step;
        element("reset").onclick = reset;
        element("replay").onclick = replay;
        element("controls").onsubmit = (event) => event.preventDefault();
    }

    /** Fills the lists of scenes and numbers of bodies, and switches the controls on. */
    fill(scenes, { scene, bodies }) {
        element("scene").replaceChildren(...scenes.map(({ name }) => new Option(name)));
        element("bodies").replaceChildren(...bodyChoices(bodies).map((n) => new Option(formatCount(n), n)));
        // Empty if there is no such scene.
        element("scene").value = scene;
        this.#scenes = scenes;
        for (const control of document.querySelectorAll("#panel :disabled")) control.disabled = false;
    }

    /** Shows why the GPU cannot be chosen. */
    showObstacle(reason = "") {
        element("obstacle").textContent = reason;
    }

    /** Shows which broad phase was faster in a replay. */
    showVerdict(text = "") {
        element("verdict").textContent = text;
    }

    /** Shows which settings are chosen. */
    showSettings({ scene, bodies, broadPhase }) {
        element("scene").value = scene;
        element("bodies").value = bodies;
        const info = this.#scenes.find(({ name }) => name === scene);
        element("about").textContent = info?.about ?? "";
        element("hard").textContent = info ? `Hard for a broad phase: ${info.hard}.` : "";
        document.querySelector(`[name=broad-phase][value=${broadPhase}]`).checked = true;
    }

    /** Shows whether the world stands still. */
    showPaused(isPaused) {
        element("pause").textContent = isPaused ? "Run" : "Pause";
    }

    /** Shows the counts of a frame, and now and then the times so far. */
    showFrame({ steps, bodies, pairs, plan }, times, isPaused) {
        element("steps").textContent = formatCount(steps);
        element("body-count").textContent = formatCount(bodies);
        element("pairs").textContent = formatCount(pairs);
        if (!isPaused && steps % STEPS_PER_REDRAW !== 0) return;
        element("plan").textContent = plan && `In the last step pbig used: ${plan}`;
        this.showTimes(times);
    }

    /** Shows the means and p99s, and draws the charts. */
    showTimes(times) {
        for (const row of document.querySelectorAll("#times tbody tr")) {
            const { time, figure } = row.dataset;
            BROAD_PHASES.forEach((name, at) => {
                row.cells[at + 1].textContent = formatMs(times.figure(name, time, figure));
            });
        }
        for (const [time, chart] of Object.entries(this.#charts)) chart.setData(times.columns(time));
    }

    /** Shows how finely the browser's clock counts. */
    showClock(milliseconds) {
        element("clock").textContent =
            `This browser's clock counts in steps of ${Number(milliseconds.toPrecision(2))} ms; means are finer than that.`;
    }
}
