// The GPU in headless Chromium, on a software adapter: the measurement finds the CPU's pairs, the simulation runs with the GPU,
// and each failure is a readable message. Environment: SHOTS, a folder for screenshots.

import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import { DESKTOP, launch, numberOf, open, openAs, PHONE, serve, textOf, waitForMessage, waitForSteps, WEBGPU } from "./browser.mjs";
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

/** Starts a measurement of these numbers of boxes. */
async function startMeasuring(page, sizes) {
    await page.evaluate((wanted) => (window.pbigPage.measure.sizes = wanted), sizes);
    await page.$eval("#measure-open", (button) => button.click());
}

/** Waits for the end of a measurement, and returns the text that tells how it ended. */
async function waitForEnd(page) {
    await page.waitForFunction(() => !document.getElementById("measure-close").hidden);
    return textOf(page, "#measure-state");
}

/** Returns the table: the cells of each row, by its label. */
function readTable(page) {
    return page.$$eval("#measure-table tr", (rows) =>
        Object.fromEntries(
            rows.map(({ cells: [label, ...cells] }) => [label.textContent, cells.map((cell) => cell.textContent)]),
        ),
    );
}

/** Opens the page, whose script `file` begins with another script. */
function openWith(file, script) {
    return open(browser, server.address + SCENE, async (page) => {
        await page.setRequestInterception(true);
        page.on("request", async (request) => {
            if (!request.url().endsWith(file)) return request.continue();
            const body = `${script}\n${await (await fetch(request.url())).text()}`;
            return request.respond({ contentType: "text/javascript", body });
        });
    });
}

test("the measurement finds the CPU's pairs, and shows and exports its table", async () => {
    const page = await openAs(browser, server.address + SCENE, DESKTOP, "light");
    await waitForSteps(page, 2);
    await page.screenshot({ path: `${shots}/gpu-before.png` });
    await startMeasuring(page, [2000, 10_000]);
    await page.waitForFunction(() => !document.getElementById("measure-table").hidden);
    await page.screenshot({ path: `${shots}/gpu-during.png` });
    assert.equal(await waitForEnd(page), "Done.");
    await page.screenshot({ path: `${shots}/gpu-after.png` });
    const table = await readTable(page);
    console.log(JSON.stringify(table));
    assert.deepEqual(table.Boxes, ["2,000", "10,000"]);
    assert.deepEqual(table["Pairs equal"], ["yes", "yes"]);
    for (const label of ["CPU, ms", "GPU, ms", "Wait"]) assert.ok(table[label].every((ms) => Number(ms) > 0), label);
    assert.match(await textOf(page, "#measure-device"), /swiftshader.*says? nothing/i);
    await checkExports(page, table);
    assert.deepEqual(page.complaints, []);
    await page.close();
});

/** Checks that the copied and the downloaded table are the one that is shown. */
async function checkExports(page, table) {
    const permissions = ["clipboard-read", "clipboard-write", "clipboard-sanitized-write"];
    await browser.defaultBrowserContext().overridePermissions(new URL(server.address).origin, permissions);
    await page.click("#measure-copy");
    await page.waitForFunction(() => document.getElementById("measure-state").textContent !== "Done.");
    assert.equal(await textOf(page, "#measure-state"), "Copied.");
    const copied = await page.evaluate(() => navigator.clipboard.readText());
    const [columns, first] = copied.split("\n").filter((line) => !line.startsWith("#"));
    assert.match(columns, /^set,boxes,pairs,cpu_ms,gpu_ms,/);
    assert.equal(Number(first.split(",")[2]), Number(table.Pairs[0].replaceAll(",", "")));
    assert.match(copied, /^# adapter: .*swiftshader/im);
    assert.match(copied, /^# limits: .*max_storage_buffer_binding_size 134217728/m);
    assert.equal(await download(page), copied);
}

/** Returns the content of the file that the page downloads. */
async function download(page) {
    const folder = await mkdtemp(`${tmpdir()}/pbig-page-`);
    const session = await page.createCDPSession();
    await session.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder, eventsEnabled: true });
    const completed = new Promise((resolve) =>
        session.on("Browser.downloadProgress", ({ state }) => state === "completed" && resolve()),
    );
    await page.click("#measure-download");
    await completed;
    const content = await readFile(`${folder}/pbig-gpu.csv`, "utf8");
    await rm(folder, { recursive: true });
    return content;
}

test("a phone in the dark shows the whole table; the world stands still meanwhile and goes on", async () => {
    const page = await openAs(browser, server.address + SCENE, PHONE, "dark");
    await waitForSteps(page, 2);
    await startMeasuring(page, [1000, 2000, 3000]);
    await page.waitForFunction(() => !document.getElementById("measure-table").hidden);
    const steps = await numberOf(page, "#steps");
    assert.equal(await waitForEnd(page), "Done.");
    assert.ok((await numberOf(page, "#steps")) <= steps + 1, "the world went on");
    await page.screenshot({ path: `${shots}/gpu-phone.png` });
    const overflow = await page.$eval("#measure-dialog", (dialog) => dialog.scrollWidth - dialog.clientWidth);
    assert.ok(overflow <= 0, `${overflow} pixels too wide`);
    await page.tap("#measure-close");
    await waitForSteps(page, steps + 10);
    assert.deepEqual(page.complaints, []);
    await page.close();
});

test("a measurement can be cancelled, and started again", async () => {
    const page = await openAs(browser, server.address + SCENE, DESKTOP, "dark");
    await waitForSteps(page, 2);
    await startMeasuring(page, [1000, 20_000]);
    await page.waitForFunction(() => !document.getElementById("measure-table").hidden);
    await page.click("#measure-cancel");
    assert.equal(await waitForEnd(page), "Cancelled.");
    await page.screenshot({ path: `${shots}/gpu-cancelled.png` });
    assert.deepEqual((await readTable(page)).Boxes, ["1,000"]);
    // Opened before the dialog's event of the close.
    await page.evaluate(() => {
        window.pbigPage.measure.sizes = [1000];
        for (const name of ["close", "open"]) document.getElementById(`measure-${name}`).click();
    });
    assert.equal(await waitForEnd(page), "Done.");
    await page.close();
});

test("each failure of the GPU ends the measurement with its reason", async () => {
    const failures = [
        ["navigator.gpu.requestAdapter = async () => null;", /^This browser has no WebGPU: it finds no GPU/],
        ["Object.defineProperty(navigator, 'gpu', { value: undefined });", /^This browser has no WebGPU: Chrome/],
        [LOSES_DEVICE, /^The measurement stopped: .*lost/],
        ["GPUDevice.prototype.popErrorScope = async () => new GPUOutOfMemoryError('planted');", /^The measurement stopped: .*memory/],
    ];
    for (const [script, reason] of failures) {
        const page = await openWith("measure-worker.js", script);
        await startMeasuring(page, [1000, 1000]);
        assert.match(await waitForEnd(page), reason);
        await page.screenshot({ path: `${shots}/gpu-failed.png` });
        await page.close();
    }
});

// The device is lost when the second number of boxes is measured.
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

test("a GPU that fails stops the simulation with its reason, which can be reset", async () => {
    const page = await openWith("worker.js", LOSES_DEVICE);
    await waitForSteps(page, 2);
    await page.click("#broad-phase .gpu");
    assert.match(await waitForMessage(page, "The simulation stopped"), /GPU failed: .*lost/);
    await page.click("#broad-phase .pbig");
    await page.click("#reset");
    await waitForSteps(page, 5);
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
