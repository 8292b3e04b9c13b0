// Runs the sets on WebGPU: node wasm/gpu/run.mjs FOLDER [CHROMIUM]
// FOLDER has the module and its JavaScript. Under node the implementation is Dawn from npm; with the program of Chromium it is
// Chromium's, in a page.
import { spawn } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, chromium] = process.argv.slice(2);

async function inNode() {
    const { create, globals } = await import("webgpu");
    // wgpu looks for the class of the global object: a page's or a worker's.
    Object.assign(globalThis, globals, { window: globalThis, Window: Object });
    Object.defineProperty(globalThis, "navigator", { value: { gpu: create([]) }, configurable: true });
    const module = await import(pathToFileURL(resolve(folder, "pbig_page_gpu.mjs")));
    module.initSync({ module: await readFile(join(folder, "pbig_page_gpu_bg.wasm")) });
    const { check } = await import("./check.mjs");
    return check(module, console.log);
}

const page = `<script type="module">
    import * as module from "/pbig_page_gpu.mjs";
    import { check } from "/check.mjs";
    const post = (to, text) => fetch(to, { method: "POST", body: String(text) });
    const isRight = module.default({ module_or_path: "/pbig_page_gpu_bg.wasm" }).then(() => check(module, (line) => post("/line", line)));
    post("/end", await isRight.catch((error) => error));
</script>`;
const types = { js: "text/javascript", mjs: "text/javascript", wasm: "application/wasm" };

// Serves the page, prints the lines that it sends, and calls `done` with its result.
function serve(done) {
    return createServer(async (request, response) => {
        const name = request.url.slice(1);
        if (request.method === "POST") {
            const parts = [];
            for await (const part of request) parts.push(part);
            response.end();
            if (name === "end") done(String(Buffer.concat(parts)));
            else console.log(String(Buffer.concat(parts)));
        } else if (name === "") {
            response.setHeader("content-type", "text/html").end(page);
        } else {
            const file = name === "check.mjs" ? new URL(name, import.meta.url) : join(folder, name);
            const content = await readFile(file).catch(() => undefined);
            if (!content) response.statusCode = 404;
            response.setHeader("content-type", types[name.split(".").pop()] ?? "text/plain").end(content);
        }
    });
}

async function inChromium() {
    const profile = await mkdtemp(join(tmpdir(), "pbig-chromium-"));
    let done;
    const result = new Promise((resolve) => (done = resolve));
    const server = serve(done);
    await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
    const options = ["--headless=new", "--no-sandbox", "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"];
    const address = `http://127.0.0.1:${server.address().port}/`;
    const browser = spawn(chromium, [...options, `--user-data-dir=${profile}`, address], { stdio: "ignore" });
    browser.on("exit", () => done("Chromium ended early"));
    const end = await result;
    browser.kill();
    server.close();
    await rm(profile, { recursive: true, force: true, maxRetries: 5 });
    if (end !== "true") console.log(end);
    return end === "true";
}

const isRight = await (chromium ? inChromium() : inNode());
console.log(isRight ? "no difference but where one was planted" : "failed");
// Dawn keeps node alive.
process.exit(isRight ? 0 : 1);
