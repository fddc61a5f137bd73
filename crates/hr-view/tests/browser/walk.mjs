// Walks through a page of hr-view --html with headless Chromium and says on standard output, as JSON, what happened.
//
//   node walk.mjs CHROMIUM WIDTH HEIGHT FOLDER PAGE [BROKEN_PAGE ...]
//
// FOLDER takes the pictures. Speaks the browser's own protocol over a pipe, so that nothing else needs to be installed.

import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [chromium, width, height, folder, page, ...broken] = process.argv.slice(2);
const profile = mkdtempSync(join(tmpdir(), "hr-view-browser-"));
const browser = spawn(chromium, [
  "--headless=new", "--no-sandbox", "--remote-debugging-pipe", `--user-data-dir=${profile}`, "--no-first-run",
  "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-color-profile=srgb",
  "about:blank",
], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
process.on("exit", () => {
  browser.kill("SIGKILL");
  // Its parts end one after the other, and may write until then; what they leave behind is no fault of the page.
  try {
    rmSync(profile, { recursive: true, force: true, maxRetries: 20 });
  } catch {}
});
browser.on("exit", (code) => { console.error(`the browser ended with ${code}`); process.exit(1); });

const waiting = new Map();
let faults = [];
let text = "";
browser.stdio[4].on("data", (data) => {
  text += data;
  for (let end; (end = text.indexOf("\0")) >= 0; text = text.slice(end + 1)) {
    const { id, error, result, method, params } = JSON.parse(text.slice(0, end));
    if (id) {
      const { resolve, reject } = waiting.get(id);
      error ? reject(new Error(error.message)) : resolve(result);
    } else if (method === "Runtime.exceptionThrown") {
      faults.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    } else if (method === "Runtime.consoleAPICalled" && ["error", "warning"].includes(params.type)) {
      faults.push(params.args.map((arg) => arg.value).join(" "));
    } else if (method === "Log.entryAdded" && ["error", "warning"].includes(params.entry.level)) {
      faults.push(params.entry.text);
    }
  }
});

let session;
const send = (method, params = {}) => new Promise((resolve, reject) => {
  const id = waiting.size + 1;
  waiting.set(id, { resolve, reject });
  browser.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId: session })}\0`);
});
const rest = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const ask = async (expression) => {
  const options = { awaitPromise: true, returnByValue: true };
  const { result, exceptionDetails } = await send("Runtime.evaluate", { expression, ...options });
  if (exceptionDetails) {
    throw new Error(`${expression}: ${exceptionDetails.exception?.description}`);
  }
  return result.value;
};

// How often the page asked for a frame.
const COUNTER = `
  self.frames = 0;
  const real = requestAnimationFrame;
  self.requestAnimationFrame = (f) => { frames++; return real(f); };
`;
const MESSAGE = `(() => {
  const place = document.getElementById("message");
  return place ? place.hidden ? "" : place.textContent : document.documentElement.textContent;
})()`;

async function open(path) {
  faults = [];
  const begin = performance.now();
  await send("Page.navigate", { url: pathToFileURL(path).href });
  for (let state; performance.now() - begin < 60_000; await rest(20)) {
    state = await ask("document.readyState === 'complete' ? document.documentElement.dataset.state ?? 'nothing' : ''");
    if (["ready", "failed", "nothing"].includes(state)) {
      const message = await ask(MESSAGE);
      return { state, message, seconds: (performance.now() - begin) / 1000 };
    }
  }
  throw new Error(`${path} is not ready after a minute`);
}

// Waits until nothing is drawn any more.
async function calm() {
  for (let last = -1, now = await ask("frames"); now !== last; now = await ask("frames")) {
    last = now;
    await rest(250);
  }
}

let pictures = 0;
async function picture() {
  await calm();
  const { data } = await send("Page.captureScreenshot", { format: "png" });
  const name = `picture-${pictures++}.png`;
  writeFileSync(join(folder, name), Buffer.from(data, "base64"));
  return { name, data };
}

const key = (type, code) => send("Input.dispatchKeyEvent", { type, code, key: code.replace(/^Key|^Digit/, "") });
async function press(code, ms = 0) {
  await key("keyDown", code);
  await rest(ms);
  await key("keyUp", code);
}

const { targetId } = await send("Target.createTarget", { url: "about:blank" });
({ sessionId: session } = await send("Target.attachToTarget", { targetId, flatten: true }));
await Promise.all(["Runtime", "Log", "Page"].map((domain) => send(`${domain}.enable`)));
await send("Page.addScriptToEvaluateOnNewDocument", { source: COUNTER });
const resize = (width, height) =>
  send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
await resize(Number(width), Number(height));

const said = await open(page);
await ask("for (const id of ['line', 'controls']) document.getElementById(id).style.visibility = 'hidden'");
const still = await picture();
const before = await ask("frames");
await rest(500);
const idle = await ask("frames") - before;
await press("Digit2");
const second = await picture();

// Each way to move changes the picture.
const moves = {};
let last = second.data;
const moved = async (name, act) => {
  await act();
  const { data } = await picture();
  moves[name] = data !== last;
  last = data;
};
const mouse = (type, x, y) =>
  send("Input.dispatchMouseEvent", { type, x, y, button: "left", buttons: 1, clickCount: 1 });
await moved("keys", () => press("KeyD", 200));
await moved("mouse", async () => {
  await mouse("mousePressed", 100, 100);
  await mouse("mouseMoved", 140, 110);
  await mouse("mouseReleased", 140, 110);
});
const touch = (type, ...points) =>
  send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
await send("Emulation.setTouchEmulationEnabled", { enabled: true, maxTouchPoints: 2 });
await moved("touch", async () => {
  await touch("touchStart", [100, 100]);
  await touch("touchMove", [130, 100]);
  await touch("touchEnd");
});
await moved("pinch", async () => {
  await touch("touchStart", [100, 100], [140, 100]);
  await touch("touchMove", [80, 100], [160, 100]);
  await touch("touchEnd");
});
await moved("exposure", () => ask("dispatchEvent(new KeyboardEvent('keydown', { key: '+' }))"));
await press("KeyH");
const help = await ask("!document.getElementById('help').hidden && document.getElementById('keys').children.length");
await press("KeyH");

// Frames a second on a walk in circles, for people to read: it depends on the machine and on what else it does.
await resize(1280, 720);
await press("Digit1");
await calm();
await key("keyDown", "KeyW");
await key("keyDown", "ArrowLeft");
const [from, begin] = [await ask("frames"), performance.now()];
await rest(2000);
const rate = (await ask("frames") - from) / (performance.now() - begin) * 1000;
await key("keyUp", "KeyW");
await key("keyUp", "ArrowLeft");
const wrong = faults;

// A device that is taken away and given back.
const begun = await picture();
await ask("self.device = document.getElementById('picture').getContext('webgl2').getExtension('WEBGL_lose_context')");
await ask("device.loseContext()");
await rest(200);
const lost = await ask("document.documentElement.dataset.state");
await ask("device.restoreContext()");
await rest(200);
const restored = lost === "waiting" && (await picture()).data === begun.data;

const damage = [];
for (const path of broken) {
  damage.push(await open(path));
}
const shown = { still: still.name, second: second.name };
console.log(JSON.stringify({ ...said, ...shown, faults: wrong, idle, moves, help, rate, restored, damage }));
process.exit(0);
