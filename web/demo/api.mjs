// What the demonstration and the figures share: the typed client, and the pictures that they take with the real viewer.
import { spawn } from "node:child_process";
import { dirname, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { waitForSession } from "../../clients/typescript/dist/pointwright.js";

export { ApiClient, decodeFrame, uploadBytes } from "../../clients/typescript/dist/pointwright.js";

export const root = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
/** A path as the user would type it. */
export const here = (path) => relative(process.cwd(), path);

export function demand(condition, reason) {
  if (!condition) throw new Error(reason);
}

/** Prints what was done, how long it took, and what is to be said about it. */
export const say = (label, ms, detail) =>
  console.log(`  ${label.padEnd(30)} ${(ms / 1000).toFixed(2).padStart(7)} s   ${detail}`);

/** Runs one step and prints its line; `work` answers what to say about it, or [what to say, the step's result]. */
export async function step(label, work) {
  const start = performance.now();
  const answer = await work();
  const [detail, result] = Array.isArray(answer) ? answer : [answer];
  say(label, performance.now() - start, detail);
  return result;
}

/** A session of the cloud, ready. */
export async function openSession(client, cloud, options) {
  const { id } = await client.createSession(cloud.id, options);
  return waitForSession(client, id);
}

/** A file that the service gives, as bytes. */
export async function download(client, path) {
  return Buffer.from(await (await client.request(path)).arrayBuffer());
}

/** A picture of the session as the viewer shows it; answers where it is. */
export function takePicture(url, sessionId, file, { camera, mode, size = "1280x800" }) {
  const args = ["web/scripts/pictures.mjs", "--url", url, "--session", sessionId, "--out", file];
  args.push("--camera", JSON.stringify(camera), "--mode", mode, "--size", size, "--ui", "0");
  return new Promise((done, fail) => {
    const child = spawn(process.execPath, args, { cwd: root, stdio: ["ignore", "pipe", "pipe"] });
    const endWithUs = () => child.kill();
    process.once("exit", endWithUs);
    child.on("close", () => process.off("exit", endWithUs));
    let text = "";
    child.stdout.on("data", (chunk) => (text += chunk));
    child.stderr.on("data", (chunk) => (text += chunk));
    child.on("error", fail);
    child.on("close", (status) =>
      status === 0
        ? done(here(file))
        : fail(new Error(`no picture ${here(file)} (status ${status}):\n${text}`)),
    );
  });
}
