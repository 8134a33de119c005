// What the demonstration and the figures ask of a daemon, and the pictures that they take with the real viewer.
import { spawn } from "node:child_process";
import { dirname, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";

export const root = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
/** A path as the user would type it. */
export const here = (path) => relative(process.cwd(), path);

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

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

/** A request to the API; anything but success is an error with the problem document's own words. */
export async function call(url, method, path, { json, body, headers = {} } = {}) {
  const response = await fetch(url + path, {
    method,
    headers: { ...(json ? { "Content-Type": "application/json" } : {}), ...headers },
    body: json ? JSON.stringify(json) : body,
  });
  if (!response.ok) {
    const text = await response.text();
    throw new Error(`${method} ${path} answered ${response.status}: ${text.slice(0, 2000)}`);
  }
  return response;
}

/** Uploads a cloud; answers its document. */
export async function upload(url, name, type, body) {
  const headers = { "Content-Type": type };
  return (await call(url, "POST", `/v1/clouds?name=${encodeURIComponent(name)}`, { body, headers })).json();
}

/** Makes a session and waits until it is ready; answers its document with its `path`. */
export async function openSession(url, params) {
  const response = await call(url, "POST", "/v1/sessions", { json: params });
  const path = response.headers.get("location");
  demand(response.status === 202 && path, "POST /v1/sessions did not answer 202 with a Location");
  for (;;) {
    const document = await (await call(url, "GET", path)).json();
    if (document.state === "ready") return { path, ...document };
    demand(
      document.state === "building",
      `the session failed: ${JSON.stringify(document.error ?? document)}`,
    );
    await sleep(20);
  }
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
