// A daemon of our own for a test or a demonstration: on a free port of loopback, ended by its process id.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const root = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
/** The environment variable POINTWRIGHTD names another build's daemon. */
export const daemonPath = process.env["POINTWRIGHTD"] ?? resolve(root, "build/release/server/pointwrightd");
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** Starts pointwrightd and waits until it answers. Answers {url, pid, log(), stop()}; stop() resolves to the exit status. */
export async function startDaemon(args = []) {
  if (!existsSync(daemonPath)) throw new Error(`${daemonPath} is not built`);
  const folder = mkdtempSync(join(tmpdir(), "pointwright-"));
  const portFile = join(folder, "port");
  const child = spawn(daemonPath, ["--port", "0", "--port-file", portFile, ...args], {
    stdio: ["ignore", "pipe", "pipe"],
  });
  let log = "";
  let status = null;
  let startError = null;
  child.stdout.on("data", (chunk) => (log += chunk));
  child.stderr.on("data", (chunk) => (log += chunk));
  child.on("error", (error) => (startError = error));
  const ended = new Promise((done) => {
    child.on("close", (code, signal) => {
      status = code ?? `signal ${signal}`;
      done(status);
    });
  });
  const endWithUs = () => child.kill("SIGKILL");
  process.on("exit", endWithUs);
  const stop = async () => {
    process.off("exit", endWithUs);
    child.kill("SIGTERM");
    const timer = setTimeout(() => child.kill("SIGKILL"), 10_000);
    const result = await ended;
    clearTimeout(timer);
    rmSync(folder, { recursive: true, force: true });
    return result;
  };

  const deadline = Date.now() + 20_000;
  while (Date.now() < deadline && status === null && startError === null) {
    const port = existsSync(portFile) ? Number(readFileSync(portFile, "utf8").trim()) : 0;
    if (port > 0) {
      const url = `http://127.0.0.1:${port}`;
      const ready = await fetch(`${url}/readyz`).then(
        (response) => response.ok,
        () => false,
      );
      if (ready) return { url, pid: child.pid, log: () => log, stop };
    }
    await sleep(25);
  }
  const reason =
    startError?.message ?? (status === null ? "did not answer within 20 s" : `ended with ${status}`);
  if (status === null && startError === null) await stop();
  else process.off("exit", endWithUs);
  throw new Error(`pointwrightd ${reason}\n${log}`);
}
