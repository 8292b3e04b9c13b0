// A file server and a headless browser for the tests.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { createInterface } from "node:readline";
import puppeteer from "puppeteer-core";

/** Environment: the folder of the page, and Chromium's program. */
const folder = process.env.PAGE_FOLDER ?? "../out/page";
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const WAIT_MS = 120_000;

export const DESKTOP = { width: 1280, height: 800 };
export const PHONE = { width: 390, height: 844, deviceScaleFactor: 2, isMobile: true, hasTouch: true };

// Graphics in software: the machine may have no GPU.
const GRAPHICS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
/** Arguments for a browser with WebGPU, in software, too. */
export const WEBGPU = [...GRAPHICS, "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"];
/** Arguments for a browser without WebGL. */
export const NO_GRAPHICS = ["--disable-3d-apis"];

/** Serves the page's folder by the command in the README. Returns the address and a function that ends the server. */
export async function serve() {
    const server = spawn("python3", ["-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "-d", folder], {
        stdio: ["ignore", "pipe", "ignore"],
    });
    const [line] = await once(createInterface(server.stdout), "line");
    const [, port] = line.match(/port (\d+)/);
    return { address: `http://127.0.0.1:${port}/`, end: () => server.kill() };
}

/** Starts Chromium. */
export function launch(graphics = GRAPHICS) {
    // A test may run as root, for whom Chromium has no sandbox.
    const args = ["--no-sandbox", ...graphics];
    return puppeteer.launch({ executablePath, args, protocolTimeout: WAIT_MS });
}

/** Opens a page, which collects what its console and its scripts complain about in `complaints`. */
export async function open(browser, address, prepare = async () => {}) {
    const page = await browser.newPage();
    page.setDefaultTimeout(WAIT_MS);
    page.complaints = [];
    page.on("console", (message) => {
        if (["error", "warn", "assert"].includes(message.type())) page.complaints.push(message.text());
    });
    page.on("pageerror", (error) => page.complaints.push(error.message));
    await prepare(page);
    await page.goto(address);
    return page;
}

/** Opens a page on a screen, in a light or a dark scheme. */
export function openAs(browser, address, viewport, scheme) {
    return open(browser, address, async (page) => {
        await page.setViewport(viewport);
        await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
    });
}

/** Returns the text of an element. */
export function textOf(page, selector) {
    return page.$eval(selector, (element) => element.textContent);
}

/** Returns the number that an element shows. */
export async function numberOf(page, selector) {
    return Number((await textOf(page, selector)).replaceAll(",", ""));
}

/** Waits until the world has made this many steps. Fails with the message that the page shows if it stops before. */
export async function waitForSteps(page, steps) {
    const handle = await page.waitForFunction(
        (wanted) => {
            const element = (id) => document.getElementById(id);
            const title = element("message-title").textContent;
            if (!element("message").hidden && !title.startsWith("Loading")) {
                return `${title}: ${element("message-text").textContent}`;
            }
            return Number(element("steps").textContent.replaceAll(",", "")) >= wanted && "done";
        },
        {},
        steps,
    );
    const outcome = await handle.jsonValue();
    if (outcome !== "done") throw new Error(outcome);
}

/** Waits until the page shows a message with this title, and returns its text. */
export async function waitForMessage(page, title) {
    const isShown = (wanted) => document.getElementById("message-title").textContent.includes(wanted);
    await page.waitForFunction(isShown, {}, title);
    return textOf(page, "#message-text");
}
