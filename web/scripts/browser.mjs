// A headless Chromium for pictures and tests: Debian's own, drawing in software, talking to nobody.
import { existsSync } from "node:fs";
import { chromium } from "playwright-core";

const PLACES = [
  process.env.CHROMIUM,
  "/usr/bin/chromium",
  "/usr/bin/chromium-browser",
  "/usr/bin/google-chrome",
];

const FLAGS = [
  "--headless",
  "--no-sandbox",
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--enable-unsafe-swiftshader",
];

/** Starts the browser; throws where there is none. */
export async function launchBrowser() {
  const executablePath = PLACES.find((path) => path && existsSync(path));
  if (!executablePath)
    throw new Error("no Chromium: set CHROMIUM to its path, or install the package chromium");
  return chromium.launch({ executablePath, args: FLAGS, timeout: 120_000 });
}

/** The viewer's own status, or null where no viewer is on the page. */
export function viewerStatus(page) {
  return page.evaluate(() => globalThis.pointwright?.status ?? null);
}

/** Waits until the viewer has samples to show and has framed them: a camera that is set now stays. */
export function waitForReady(page, timeoutMs = 300_000) {
  return waitForStatus(page, "ready", (s) => s.state === "ready" && s.loadedSamples > 0, 1, timeoutMs);
}

/** Waits until the viewer shows its session whole and has nothing left to draw. */
export function waitForIdle(page, timeoutMs = 300_000) {
  return waitForStatus(page, "idle", (status) => status.idle && status.state === "ready", 2, timeoutMs);
}

async function waitForStatus(page, name, holds, times, timeoutMs) {
  const ends = Date.now() + timeoutMs;
  for (let seen = 0; seen < times; ) {
    const status = await viewerStatus(page);
    if (status?.state === "failed")
      throw new Error("the viewer failed: the session or its picture could not be opened");
    seen = status && holds(status) ? seen + 1 : 0;
    if (Date.now() > ends)
      throw new Error(`the viewer is not ${name} after ${timeoutMs} ms: ${JSON.stringify(status)}`);
    if (seen < times) await new Promise((resolve) => setTimeout(resolve, 120));
  }
}
