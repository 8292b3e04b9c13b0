// The GPU in headless Chromium, on a software adapter: the simulation has the CPU's pairs, and after each failure the CPU goes on.
// Environment: SHOTS, a folder for screenshots.

import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { after, before, test } from "node:test";
import { DESKTOP, launch, numberOf, open, openAs, serve, textOf, waitForSteps, WEBGPU } from "./browser.mjs";
import { firstDifference } from "./pairs.mjs";

const shots = process.env.SHOTS ?? "../out/page-shots";
const SCENE = "?scene=column&bodies=100";
// Steps whose pairs are compared. A software adapter takes tenths of a second for each.
const STEPS = 20;

let server, browser;

before(async () => {
    mkdirSync(shots, { recursive: true });
    [server, browser] = [await serve(), await launch(WEBGPU)];
});

after(async () => {
    await browser?.close();
    server?.end();
});

/** Opens the page, whose script `file` begins with another script. */
function openWith(file, script, query = "") {
    return open(browser, server.address + SCENE + query, async (page) => {
        await page.setRequestInterception(true);
        page.on("request", async (request) => {
            if (!request.url().endsWith(file)) return request.continue();
            const body = `${script}\n${await (await fetch(request.url())).text()}`;
            return request.respond({ contentType: "text/javascript", body });
        });
    });
}

// The device is lost after some steps.
const LOSES_DEVICE = `{
    let devices = [], calls = 0;
    const { requestDevice } = GPUAdapter.prototype, { submit } = GPUQueue.prototype;
    GPUAdapter.prototype.requestDevice = async function (...all) {
        const device = await requestDevice.apply(this, all);
        devices.push(device);
        return device;
    };
    GPUQueue.prototype.submit = function (...all) {
        if (++calls === 12) devices.forEach((device) => device.destroy());
        return submit.apply(this, all);
    };
}`;

// No search brings pairs.
const DECLINES = `{
    const { Suspending } = WebAssembly;
    WebAssembly.Suspending = function () {
        return new Suspending(async () => {});
    };
}`;

test("the simulation has the same pairs with the GPU as with the CPU", async () => {
    const page = await openAs(browser, server.address + SCENE, DESKTOP, "light");
    await waitForSteps(page, 1);
    for (const scene of ["column", "sensors"]) {
        const pairsWith = (broadPhase) =>
            page.evaluate((s, n) => window.pbigPage.pairs(s, n), { scene, bodies: 200, seed: 1, broadPhase }, STEPS);
        const [gpu, cpu] = [await pairsWith("gpu"), await pairsWith("pbig")];
        assert.equal(gpu.length, STEPS);
        assert.equal(firstDifference(gpu, cpu), undefined, `${scene}: the first step that differs`);
        console.log(`${scene}: ${gpu.at(-1).length / 2} pairs in step ${STEPS}, all steps equal`);
    }
    await page.close();
});

test("the broad phase changes to the GPU and back while the world runs", async () => {
    const page = await openAs(browser, server.address + SCENE, DESKTOP, "light");
    await waitForSteps(page, 20);
    await page.click("#broad-phase .gpu");
    await page.waitForFunction(() => location.search.includes("broad-phase=gpu"));
    await page.waitForFunction(() => document.getElementById("plan").textContent.includes("device: 101 boxes"));
    await page.screenshot({ path: `${shots}/gpu-simulation.png` });
    await page.click("#broad-phase .stock");
    await waitForSteps(page, 30 + (await numberOf(page, "#steps")));
    const times = await page.$$eval("#times tbody td", (cells) => cells.map((cell) => Number(cell.textContent)));
    assert.ok(times.every((ms) => ms > 0), `${times}`);
    assert.deepEqual(page.complaints, []);
    await page.close();
});

test("where the GPU fails or cannot be opened the CPU goes on, and the page says why", async () => {
    const failures = [
        [LOSES_DEVICE, /^The CPU goes on: The GPU failed: .*lost/],
        ["GPUDevice.prototype.popErrorScope = async () => new GPUOutOfMemoryError('planted');", /memory/],
        ["GPUAdapter.prototype.requestDevice = async () => { throw new Error('planted'); };", /planted/],
    ];
    for (const [script, reason] of failures) {
        const page = await openWith("worker.js", script);
        await waitForSteps(page, 2);
        await page.click("#broad-phase .gpu");
        await page.waitForFunction(() => document.getElementById("obstacle").textContent);
        assert.match(await textOf(page, "#obstacle"), reason);
        assert.equal(await page.$eval("[name=broad-phase]:checked", ({ value }) => value), "pbig");
        assert.match(page.url(), /broad-phase=pbig/);
        await waitForSteps(page, 10 + (await numberOf(page, "#steps")));
        await page.screenshot({ path: `${shots}/gpu-failed.png` });
        await page.close();
    }
});

test("a step that the GPU declines shows no time of the GPU", async () => {
    const page = await openWith("worker.js", DECLINES);
    await waitForSteps(page, 2);
    await page.click("#broad-phase .gpu");
    await page.waitForFunction(() => location.search.includes("broad-phase=gpu"));
    await waitForSteps(page, 10 + (await numberOf(page, "#steps")));
    const times = await page.$$eval("#times td:nth-child(4)", (cells) => cells.map((cell) => cell.textContent));
    assert.deepEqual(times.slice(-4), ["–", "–", "–", "–"]);
    assert.equal(await page.$eval("[name=broad-phase]:checked", ({ value }) => value), "gpu");
    await page.close();
});

test("a scene that begins with a GPU that cannot be opened begins with the CPU", async () => {
    const planted = "GPUAdapter.prototype.requestDevice = async () => { throw new Error('planted'); };";
    const page = await openWith("worker.js", planted, "&broad-phase=gpu");
    await waitForSteps(page, 5);
    assert.match(await textOf(page, "#obstacle"), /^The CPU goes on: .*planted/);
    await page.close();
});

test("without a way to wait for the GPU the choice says so, and the world goes on", async () => {
    const page = await open(browser, server.address + SCENE, (page) =>
        page.evaluateOnNewDocument(() => delete WebAssembly.promising),
    );
    await waitForSteps(page, 2);
    await page.click("#broad-phase .gpu");
    await page.waitForFunction(() => document.getElementById("obstacle").textContent.includes("137"));
    assert.equal(await page.$eval("[name=broad-phase]:checked", ({ value }) => value), "pbig");
    await page.screenshot({ path: `${shots}/gpu-obstacle.png` });
    await waitForSteps(page, 10);
    await page.close();
});
