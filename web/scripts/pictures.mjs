// A picture of a session, by the real viewer:
//
//   node web/scripts/pictures.mjs --url URL --session ID --out FILE.png
//     [--camera '{"position":[x,y,z],"target":[x,y,z],"up":[x,y,z]}']   in model space
//     [--mode shaded|regions|color|normals|t|detail] [--size 1600x1000] [--ui 0|1]
import { mkdirSync } from "node:fs";
import { dirname, resolve } from "node:path";
import { parseArgs } from "node:util";
import { launchBrowser, waitForIdle, waitForReady } from "./browser.mjs";

const MODES = ["shaded", "regions", "color", "normals", "t", "detail"];

function fail(message) {
  console.error(`pictures: ${message}`);
  process.exit(2);
}

function readArguments() {
  const { values } = parseArgs({
    options: {
      url: { type: "string" },
      session: { type: "string" },
      out: { type: "string" },
      camera: { type: "string" },
      mode: { type: "string", default: "regions" },
      size: { type: "string", default: "1600x1000" },
      ui: { type: "string", default: "0" },
    },
  });
  for (const name of ["url", "session", "out"]) if (!values[name]) fail(`--${name} is missing`);
  if (!MODES.includes(values.mode)) fail(`--mode is one of ${MODES.join(", ")}`);
  if (values.ui !== "0" && values.ui !== "1") fail("--ui is 0 or 1");
  const size = /^(\d{2,4})x(\d{2,4})$/.exec(values.size);
  if (!size) fail("--size is WIDTHxHEIGHT");
  let camera = null;
  if (values.camera) {
    try {
      camera = JSON.parse(values.camera);
    } catch {
      fail("--camera is not JSON");
    }
  }
  return { ...values, camera, width: Number(size[1]), height: Number(size[2]) };
}

const options = readArguments();
const browser = await launchBrowser();
try {
  const page = await browser.newPage({
    viewport: { width: options.width, height: options.height },
    reducedMotion: "reduce",
  });
  page.setDefaultTimeout(300_000);
  const troubles = [];
  page.on("pageerror", (error) => troubles.push(error.message));
  page.on("console", (message) => message.type() === "error" && troubles.push(message.text()));
  const address = new URL(
    `./?session=${encodeURIComponent(options.session)}&ui=${options.ui}`,
    options.url.replace(/\/?$/, "/"),
  );
  address.hash = `mode=${options.mode}`;
  await page.goto(address.href);
  if (options.camera) {
    await waitForReady(page);
    await page.evaluate((camera) => {
      globalThis.pointwright.camera = camera;
    }, options.camera);
  }
  await waitForIdle(page);
  const out = resolve(options.out);
  mkdirSync(dirname(out), { recursive: true });
  await page.screenshot({ path: out, timeout: 300_000 });
  if (troubles.length > 0) throw new Error(`the page reported: ${troubles.join("; ")}`);
} finally {
  await browser.close();
}
