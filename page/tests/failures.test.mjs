// Each failure is a readable message in the page.

import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { after, before, test } from "node:test";
import { launch, NO_GRAPHICS, open, serve, waitForMessage, waitForSteps } from "./browser.mjs";

const shots = process.env.SHOTS ?? "../out/page-shots";
const folder = process.env.PAGE_FOLDER ?? "../out/page";
let server, browser;

before(async () => {
    mkdirSync(shots, { recursive: true });
    [server, browser] = [await serve(), await launch()];
});

after(async () => {
    await browser?.close();
    server?.end();
});

test("without WebGL", async () => {
    const without = await launch(NO_GRAPHICS);
    const page = await open(without, server.address);
    const text = await waitForMessage(page, "no WebGL 2");
    assert.match(text, /graphics acceleration/);
    await page.screenshot({ path: `${shots}/no-webgl.png` });
    await without.close();
});

test("without WebAssembly", async () => {
    const page = await open(browser, server.address, (page) =>
        page.evaluateOnNewDocument(() => delete globalThis.WebAssembly),
    );
    await waitForMessage(page, "no WebAssembly");
});

test("without Web Workers", async () => {
    const page = await open(browser, server.address, (page) =>
        page.evaluateOnNewDocument(() => delete globalThis.Worker),
    );
    await waitForMessage(page, "no Web Workers");
});

/** Opens the page where requests for a file are answered with 404. */
function openWithout(file) {
    return open(browser, server.address, async (page) => {
        await page.setRequestInterception(true);
        page.on("request", (request) =>
            request.url().endsWith(file) ? request.respond({ status: 404 }) : request.continue(),
        );
    });
}

test("a script that is not there", async () => {
    const page = await openWithout("main.js");
    assert.match(await waitForMessage(page, "A part of the page is missing"), /main\.js/);
});

test("a worker that is not there", async () => {
    const page = await openWithout("worker.js");
    assert.match(await waitForMessage(page, "The simulation stopped"), /worker\.js/);
});

test("without module workers", async () => {
    const page = await open(browser, server.address, (page) =>
        page.evaluateOnNewDocument(() => {
            globalThis.Worker = class {
                terminate() {}
            };
        }),
    );
    await waitForMessage(page, "no module workers");
});

test("opened as a file", async () => {
    const page = await open(browser, `${pathToFileURL(resolve(folder))}/index.html`);
    await waitForMessage(page, "needs a file server");
});

test("a wrong address says what is right", async () => {
    const page = await open(browser, `${server.address}?bodies=many`);
    assert.match(await waitForMessage(page, "could not start"), /'many'.*from 1 to/);
    const other = await open(browser, `${server.address}?scene=colum`);
    assert.match(await waitForMessage(other, "The simulation stopped"), /'colum'.*column, spheres/);
});

test("after a failure the simulation can be reset", async () => {
    const page = await open(browser, `${server.address}?scene=colum`);
    await waitForMessage(page, "The simulation stopped");
    await page.select("#scene", "column");
    await waitForSteps(page, 5);
});

test("a lost graphics context", async () => {
    const page = await open(browser, `${server.address}?bodies=100`);
    await waitForSteps(page, 2);
    const lose = () => {
        const context = document.getElementById("canvas").getContext("webgl2");
        context.getExtension("WEBGL_lose_context").loseContext();
    };
    await page.evaluate(lose);
    assert.match(await waitForMessage(page, "The simulation stopped"), /Reload the page/);
});

test("a simulation that is dropped in the middle of a call does not stop the next one", async () => {
    const page = await open(browser, `${server.address}?bodies=5000`);
    await waitForSteps(page, 1);
    await page.evaluate(() => {
        const [canvas, reset] = ["canvas", "reset"].map((id) => document.getElementById(id));
        // The page's own listener is called before this one: the simulation has failed, and still builds.
        canvas.addEventListener("webglcontextlost", () => reset.click());
        reset.click();
        canvas.getContext("webgl2").getExtension("WEBGL_lose_context").loseContext();
    });
    await page.waitForFunction(() => {
        const [message, title] = ["message", "message-title"].map((id) => document.getElementById(id));
        return message.hidden || !title.textContent.startsWith("Loading");
    });
    await waitForSteps(page, 1);
});
