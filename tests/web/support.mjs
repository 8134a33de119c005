// What the browser tests share: a synthetic cloud, a daemon of their own with the built viewer, a page that is watched.

import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, resolve } from "node:path";
import { after, before } from "node:test";
import { fileURLToPath } from "node:url";
import { startDaemon } from "../../web/demo/daemon.mjs";
import { launchBrowser, waitForIdle } from "../../web/scripts/browser.mjs";

export const root = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
export const waitMs = 240_000;

const fromWeb = createRequire(resolve(root, "web/package.json"));
const axePath = fromWeb.resolve("axe-core/axe.min.js");

/** A capsule along x with bumps, as a binary PLY: `count` samples, evenly spread. */
export function capsulePly(count) {
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n`;
  const body = Buffer.alloc(12 * count);
  const golden = Math.PI * (3 - Math.sqrt(5));
  for (let i = 0; i < count; i++) {
    // The capsule of radius 0.4 about the segment from x = -0.8 to 0.8, cut into equal areas along x.
    const x = -1.2 + (2.4 * (i + 0.5)) / count;
    const off = Math.max(0, Math.abs(x) - 0.8);
    const radius =
      Math.sqrt(Math.max(0, 0.16 - off * off)) * (1 + 0.012 * Math.sin(25 * x) * Math.sin(6 * golden * i));
    body.writeFloatLE(x, 12 * i);
    body.writeFloatLE(radius * Math.cos(golden * i), 12 * i + 4);
    body.writeFloatLE(radius * Math.sin(golden * i), 12 * i + 8);
  }
  return Buffer.concat([Buffer.from(header, "latin1"), body]);
}

/** A JSON answer of the daemon; throws where it refuses. */
export async function json(url, init) {
  const response = await fetch(url, init);
  if (!response.ok)
    throw new Error(`${init?.method ?? "GET"} ${url}: ${response.status} ${await response.text()}`);
  return response.json();
}

async function startService(args) {
  const dist = resolve(root, "web/dist");
  if (!existsSync(resolve(dist, "index.html"))) throw new Error("web/dist is not built");
  return startDaemon(["--web", dist, ...args]);
}

/** A session of a synthetic capsule, ready; on so many of its samples, or on all. */
export async function createSession(service, count = 12_000, preview = undefined) {
  const cloud = await json(`${service.url}/v1/clouds?name=capsule.ply`, {
    method: "POST",
    headers: { "Content-Type": "application/x-ply" },
    body: capsulePly(count),
  });
  const session = await json(`${service.url}/v1/sessions`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({
      cloud: cloud.id,
      name: "Capsule",
      ...(preview === undefined ? {} : { preview: { count: preview } }),
    }),
  });
  const ends = Date.now() + waitMs;
  for (;;) {
    const now = await json(`${service.url}/v1/sessions/${session.id}`);
    if (now.state === "ready") return now;
    if (now.state === "failed" || Date.now() > ends) throw new Error(`the session is ${now.state}`);
    await new Promise((done) => setTimeout(done, 100));
  }
}

/** The browser, and pages that collect what went wrong on them. */
async function openBrowser() {
  const browser = await launchBrowser();
  const open = async (url, size = { width: 900, height: 620 }) => {
    const page = await browser.newPage({ viewport: size, reducedMotion: "reduce", acceptDownloads: true });
    page.setDefaultTimeout(waitMs);
    const troubles = [];
    page.on("pageerror", (error) => troubles.push(`error: ${error.message}`));
    page.on("console", (message) => {
      if (message.type() === "error") troubles.push(`console: ${message.text()}`);
    });
    await page.addInitScript(() => {
      globalThis.violations = [];
      document.addEventListener("securitypolicyviolation", (event) => {
        globalThis.violations.push(`${event.violatedDirective} ${event.blockedURI}`);
      });
    });
    await page.goto(url);
    return { page, troubles };
  };
  return { browser, open };
}

export function sessionUrl(service, session, hash = "") {
  return `${service.url}/?session=${session.id}${hash}`;
}

/** Waits until the viewer shows at least `revision` and rests. */
export async function waitForRevision(page, revision) {
  await page.waitForFunction((wanted) => globalThis.pointwright?.status.revision >= wanted, revision, {
    timeout: waitMs,
  });
  await waitForIdle(page, waitMs);
}

/** Places on the canvas by fractions of it. */
export async function canvasPlace(page) {
  const box = await page.locator("canvas.viewport-canvas").boundingBox();
  return (u, v) => [box.x + u * box.width, box.y + v * box.height];
}

/** Drags the mouse along places of the canvas. */
export async function drag(page, places, steps = 4) {
  const at = await canvasPlace(page);
  const [first, ...rest] = places;
  await page.mouse.move(...at(...first));
  await page.mouse.down();
  for (const place of rest) await page.mouse.move(...at(...place), { steps });
  await page.mouse.up();
}

/** A handle on {data, width, height} of a screenshot, in the browser: four bytes a pixel. */
export function pixelsOf(page, shot) {
  return page.evaluateHandle(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    return context.getImageData(0, 0, bitmap.width, bitmap.height);
  }, shot.toString("base64"));
}

/** What the canvas shows, counted in the browser: blue, red and surface pixels, and the surface's extent in fractions. */
export async function countPixels(page) {
  const shot = await page.locator("canvas.viewport-canvas").screenshot({ timeout: waitMs });
  return (await pixelsOf(page, shot)).evaluate(({ data: pixels, width, height }) => {
    const result = { blue: 0, red: 0, surface: 0, top: 1, bottom: 0, left: 1, right: 0, redY: 0, redX: 0 };
    for (let y = 0; y < height; y++) {
      // The tools lie over the left edge.
      for (let x = 70; x < width; x++) {
        const at = 4 * (y * width + x);
        const [r, g, b] = [pixels[at], pixels[at + 1], pixels[at + 2]];
        const blue = b > 70 && b > 1.6 * r && b > 1.2 * g;
        const red = r > 70 && r > 1.7 * g && r > 1.7 * b;
        // The background is darker than any lit place of the surface.
        const clay = Math.max(r, g, b) > 60;
        if (blue) result.blue++;
        if (red) {
          result.red++;
          result.redX += x / width;
          result.redY += y / height;
        }
        if (!(blue || red || clay)) continue;
        result.surface++;
        result.top = Math.min(result.top, y / height);
        result.bottom = Math.max(result.bottom, y / height);
        result.left = Math.min(result.left, x / width);
        result.right = Math.max(result.right, x / width);
      }
    }
    if (result.red > 0) {
      result.redX /= result.red;
      result.redY /= result.red;
    }
    return result;
  });
}

/** Fails where the page reported an error or broke the content security policy. */
export async function checkTroubles(page, troubles) {
  const violations = await page.evaluate(() => globalThis.violations);
  const all = [...troubles, ...violations];
  if (all.length > 0) throw new Error(`the page reported: ${all.join("; ")}`);
}

/** What an automatic audit finds that matters. */
export async function seriousFindings(page) {
  // Through the debugger, as the content security policy lets no script be added.
  await page.evaluate(readFileSync(axePath, "utf8"));
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  return violations
    .filter(({ impact }) => impact === "serious" || impact === "critical")
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(" | ")}`);
}

/** What a test may take, on slow machines too. */
export const timeout = 600_000;
/** The daemon, and what opens a page, while a file's tests run. */
export let service;
export let open;

/** Starts a daemon, with these arguments, and a browser before this file's tests, and ends them afterwards. */
export function startAroundTests(args = []) {
  let browser;
  before(
    async () => {
      service = await startService(args);
      ({ browser, open } = await openBrowser());
    },
    { timeout },
  );
  after(async () => {
    await browser?.close();
    await service?.stop();
  });
}

/** Looks at the capsule from the front. */
export const frontCamera = { position: [0, 0, 6], target: [0, 0, 0], up: [0, 1, 0] };

/** Types numbers into the fields of these labels, in this order. */
export async function fill(form, numbers) {
  for (const [label, value] of Object.entries(numbers))
    await form.getByLabel(label, { exact: true }).fill(String(value));
}

/** A page with a session of its own, seen from the front, at rest. */
export async function openEditor(samples = 12_000, size = undefined, preview = undefined) {
  const session = await createSession(service, samples, preview);
  const { page, troubles } = await open(sessionUrl(service, session), size);
  await waitForIdle(page, waitMs);
  await page.evaluate((camera) => {
    globalThis.pointwright.camera = camera;
  }, frontCamera);
  await waitForIdle(page, waitMs);
  const state = () => json(`${service.url}/v1/sessions/${session.id}`);
  const edits = () => json(`${service.url}/v1/sessions/${session.id}/edits`);
  const close = async () => {
    await checkTroubles(page, troubles);
    await page.close();
  };
  return { page, session, state, edits, close };
}

/** A place of the front plane z = 0, in fractions of the canvas, as the front camera sees it. */
export async function project(page, x, y) {
  const { width, height } = await page.locator("canvas.viewport-canvas").boundingBox();
  const perUnit = height / 2 / (6 * Math.tan((16 * Math.PI) / 180));
  return [0.5 + (x * perUnit) / width, 0.5 - (y * perUnit) / height];
}

/** Waits until the condition holds. */
export async function until(holds, what) {
  const ends = Date.now() + waitMs;
  while (!(await holds())) {
    if (Date.now() > ends) throw new Error(what);
    await new Promise((done) => setTimeout(done, 200));
  }
}

/** Paints the left cap zero and the right cap one, through the API. */
export async function paintCaps(session, page) {
  const url = (region) => `${service.url}/v1/sessions/${session.id}/regions/${region}/operations`;
  const paint = (region, sign) => {
    const [min, max] =
      sign < 0
        ? [
            [-3, -3, -3],
            [-0.7, 3, 3],
          ]
        : [
            [0.7, -3, -3],
            [3, 3, 3],
          ];
    const operation = { mode: "add", shape: { type: "box", min, max } };
    return json(url(region), {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(operation),
    });
  };
  await paint("zero", -1);
  const { revision } = await paint("one", 1);
  await waitForRevision(page, revision);
}
