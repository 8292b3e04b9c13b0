// Connects panel, simulation and stage.

import { hideMessage, showMessage } from "./message.js";
import { Pace, STEP_MS } from "./pace.js";
import { Panel } from "./panel.js";
import { replayable, REPLAY_STEPS, verdict, WARM_UP_STEPS, warmUpSettings } from "./replay.js";
import { findMissing } from "./requirements.js";
import { formatSettings, parseSettings } from "./settings.js";
import { Simulation, SimulationEnded } from "./simulation.js";
import { Stage } from "./stage.js";
import { Times } from "./times.js";
import { gpuObstacle } from "./webgpu.js";

const NARROW_SCREEN = "(max-width: 760px)";
// Where drawing is slow, steps go on between the frames.
const SLOW_FRAME_MS = 2 * STEP_MS;
const TIMER_MS = STEP_MS / 2;
const CONTEXT_LOST = new Error("The browser took the graphics context away. Reload the page.");

class Page {
    #settings;
    #simulation;
    #stage;
    #panel;
    #times = new Times();
    #choice;
    #pace = new Pace();
    #isPaused = false;
    // Its `left` has the broad phases that the replay has yet to show, once it has warmed up. Undefined without a replay.
    #replay;
    // True between a failure and the next reset.
    #hasFailed = false;
    // Each task waits for the one before it.
    #tasks = Promise.resolve();
    #isStepping = false;
    #lastFrame = 0;

    async start() {
        const missing = await findMissing();
        if (missing) return showMessage(`This browser has no ${missing.name}`, `The page needs it. ${missing.advice}`);
        try {
            this.#settings = parseSettings(location.search, matchMedia(NARROW_SCREEN).matches);
            this.#stage = new Stage(document.getElementById("canvas"), () => this.#fail(CONTEXT_LOST));
        } catch (error) {
            return showMessage("The page could not start", error.message);
        }
        this.#panel = new Panel(this.#actions());
        this.#panel.showClock(clockResolution());
        this.#build();
        requestAnimationFrame((now) => this.#frame(now));
        setInterval(() => this.#stepBetweenFrames(performance.now()), TIMER_MS);
    }

    /** Returns the pairs of a scene after each step, from a worker of its own. */
    async pairs(settings, steps) {
        const simulation = new Simulation();
        await simulation.load();
        const pairs = await simulation.pairs(settings, steps);
        simulation.end();
        return pairs.map((step) => Array.from(step));
    }

    #actions() {
        return {
            change: (changed) => this.#change(changed),
            changeBroadPhase: (name) => this.#changeBroadPhase(name),
            pause: () => this.#pause(!this.#isPaused),
            step: () => this.#stepOnce(),
            reset: () => this.#build(),
            replay: () => this.#startReplay(),
        };
    }

    #change(changed) {
        this.#settings = { ...this.#settings, ...changed };
        this.#build();
    }

    async #changeBroadPhase(broadPhase) {
        const choice = (this.#choice = {});
        const obstacle = broadPhase === "gpu" ? await gpuObstacle() : undefined;
        if (choice !== this.#choice) return; // There was a later one.
        this.#panel.showObstacle(obstacle);
        if (obstacle) return this.#showSettings();
        this.#replay = undefined;
        this.#settings = { ...this.#settings, broadPhase };
        this.#showSettings();
        this.#do(async () => {
            const failure = await this.#simulation?.changeBroadPhase(broadPhase);
            if (failure) this.#goOnWithCpu(failure);
        });
    }

    #pause(isPaused) {
        this.#isPaused = isPaused;
        this.#panel.showPaused(isPaused);
        this.#panel.showTimes(this.#times);
    }

    #stepOnce() {
        this.#pause(true);
        this.#do(() => this.#step());
    }

    #showSettings() {
        this.#panel.showSettings(this.#settings);
        history.replaceState(null, "", formatSettings(this.#settings));
    }

    #build() {
        if (this.#hasFailed) this.#dropSimulation();
        this.#replay = undefined;
        showMessage("Loading…");
        this.#do(async () => {
            this.#simulation ??= await this.#load();
            this.#clearTimes();
            const { scenery } = await this.#buildScene();
            this.#stage.lookAt(scenery.movingBox);
        });
    }

    async #buildScene() {
        const frame = await this.#simulation.build(this.#settings);
        if (frame.failure) this.#goOnWithCpu(frame.failure);
        this.#showSettings();
        this.#show(frame);
        hideMessage();
        return frame;
    }

    #clearTimes() {
        this.#times = new Times();
        this.#panel.showVerdict();
    }

    // The worker has changed the broad phase already.
    #goOnWithCpu(reason) {
        this.#replay = undefined;
        this.#settings = { ...this.#settings, broadPhase: "pbig" };
        this.#showSettings();
        this.#panel.showObstacle(`The CPU goes on: ${reason}`);
    }

    /** Shows the scene from its start with each broad phase in turn. */
    #startReplay() {
        if (this.#hasFailed) return;
        const replay = (this.#replay = {});
        showMessage("Warming up…");
        this.#do(async () => {
            const names = await this.#warmUp();
            hideMessage();
            if (replay !== this.#replay) return; // It was given up.
            replay.left = names;
            this.#clearTimes();
            await this.#replayNext();
            this.#pause(false);
        });
    }

    /** Returns the broad phases that a replay can show. */
    async #warmUp() {
        const names = [];
        for (const name of replayable(await gpuObstacle())) {
            try {
                await this.#simulation.pairs(warmUpSettings(this.#settings, name), WARM_UP_STEPS);
                names.push(name);
            } catch (error) {
                if (name !== "gpu") throw error;
                this.#panel.showObstacle(error.message);
            }
        }
        return names;
    }

    async #replayNext() {
        const broadPhase = this.#replay.left.shift();
        if (!broadPhase) return this.#endReplay();
        this.#settings = { ...this.#settings, broadPhase };
        await this.#buildScene();
    }

    #endReplay() {
        this.#replay = undefined;
        this.#pause(true);
        this.#panel.showVerdict(verdict(this.#times));
    }

    // A module that trapped cannot be used again.
    #dropSimulation() {
        this.#simulation?.end();
        this.#simulation = undefined;
        this.#hasFailed = false;
    }

    async #load() {
        const simulation = new Simulation();
        try {
            this.#panel.fill(await simulation.load(), this.#settings);
        } catch (error) {
            simulation.end();
            throw error;
        }
        return simulation;
    }

    async #step() {
        // The simulation may have been dropped since this step was due.
        if (!this.#simulation) return;
        const frame = await this.#simulation.step();
        if (frame.failure) this.#goOnWithCpu(frame.failure);
        // A step that the GPU leaves to the CPU shows the time of neither.
        else if (!frame.hasDeclined) this.#times.add(frame);
        this.#show(frame);
        if (this.#replay?.left && frame.steps >= REPLAY_STEPS) await this.#replayNext();
    }

    #show(frame) {
        if (frame.scenery) this.#stage.setScenery(frame.scenery);
        this.#stage.setMatrices(frame.matrices);
        this.#panel.showFrame(frame, this.#times, this.#isPaused);
    }

    // Runs a task after those before it. None runs after a failure.
    #do(task) {
        this.#tasks = this.#tasks.then(() => this.#hasFailed || task()).catch((error) => this.#failUnlessEnded(error));
        return this.#tasks;
    }

    #frame(now) {
        this.#lastFrame = now;
        this.#stepIfDue(now);
        this.#stage.draw(now);
        requestAnimationFrame((next) => this.#frame(next));
    }

    #stepBetweenFrames(now) {
        const isSlow = now - this.#lastFrame > SLOW_FRAME_MS;
        if (isSlow && !document.hidden) this.#stepIfDue(now);
    }

    #stepIfDue(now) {
        if (this.#isPaused || this.#isStepping || this.#hasFailed || !this.#pace.takeStep(now)) return;
        this.#isStepping = true;
        this.#do(() => this.#step()).then(() => (this.#isStepping = false));
    }

    // What a dropped simulation still had to do is of no concern to the next one.
    #failUnlessEnded(error) {
        if (!(error instanceof SimulationEnded)) this.#fail(error);
    }

    #fail(error) {
        this.#hasFailed = true;
        showMessage("The simulation stopped", error.message);
    }
}

/** Returns the smallest difference of two times of the clock, in milliseconds. */
function clockResolution() {
    const start = performance.now();
    let now = start;
    while (now === start) now = performance.now();
    return now - start;
}

const page = new Page();
// For tests: the pairs of any scene, step by step.
window.pbigPage = { pairs: (settings, steps) => page.pairs(settings, steps) };
page.start();
