// What is acknowledged survives: kill -9 under load and while the daemon comes back, a full disk, a damaged file, a
// second daemon on the folder.
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { root } from "../support/process.mjs";
import { asJson, ask, documentOf, lift, paintedSession, Report, randomFrom, sleep } from "./support.mjs";

const binary = process.env.POINTWRIGHTD ?? resolve(root, "build/release/server/pointwrightd");
const writerCount = 4;

/** A daemon on the folder, once it is ready: {url, child, ended, ms}. */
async function start(work) {
  const portFile = join(work, "port");
  rmSync(portFile, { force: true });
  const data = join(work, "data");
  const child = spawn(
    binary,
    ["--port", "0", "--port-file", portFile, "--data", data, "--log-level", "off"],
    {
      stdio: "ignore",
    },
  );
  const ended = new Promise((done) => child.once("exit", done));
  const begin = Date.now();
  for (;;) {
    let port = "";
    try {
      port = readFileSync(portFile, "utf8");
    } catch {}
    if (port.endsWith("\n"))
      return { url: `http://127.0.0.1:${port.trim()}`, child, ended, ms: Date.now() - begin };
    if (child.exitCode !== null || Date.now() - begin > 30_000) throw new Error("the daemon does not start");
    await sleep(5);
  }
}
async function kill(daemon) {
  daemon.child.kill("SIGKILL");
  await daemon.ended;
}

/** Edits its own session; what got no answer is sent again, with its key, to the next daemon. */
class Writer {
  hashes = [];
  complaints = [];
  sent = 0;
  pending = null;
  isHarmed = false;
  constructor({ cloud, path }) {
    Object.assign(this, { cloud, path });
  }
  /** Edits until the daemon is gone, at most so often. */
  async write(daemon, most = Number.POSITIVE_INFINITY) {
    for (let count = 0; count < most; ++count) {
      this.pending ??= { key: `${this.path}#${++this.sent}`, body: lift(0.01 + 0.001 * (this.sent % 9)) };
      const answer = await ask(daemon.url, "POST", `${this.path}/edits`, {
        body: this.pending.body,
        headers: { ...asJson, "If-Match": "*", "Idempotency-Key": this.pending.key },
      });
      if (answer.status === 0) return;
      if (answer.status === 201) {
        const edit = documentOf(answer);
        this.hashes.push(edit.surface_hash);
        if (edit.index !== this.hashes.length) this.complaints.push(`edit ${edit.index} is out of order`);
        this.pending = null;
      } else if ([409, 503, 507].includes(answer.status)) {
        await sleep(20);
      } else {
        this.complaints.push(`an edit is answered with ${answer.status}`);
        return;
      }
    }
  }
  /** Whether all that was acknowledged is there, in its order and once. */
  async verify(daemon) {
    let session = null;
    for (let i = 0; i < 3000 && (session === null || session.state === "building"); ++i) {
      if (session !== null) await sleep(20);
      session = documentOf(await ask(daemon.url, "GET", this.path));
    }
    if (session?.state !== "ready") {
      this.complaints.push(`the session does not come back: ${JSON.stringify(session)}`);
      return;
    }
    for (let i = 0; i < 100 && this.pending; ++i) await this.write(daemon, 1);
    const found = documentOf(await ask(daemon.url, "GET", `${this.path}/edits`)).edits;
    const hashes = found.map((edit) => edit.surface_hash);
    if (JSON.stringify(hashes) !== JSON.stringify(this.hashes))
      this.complaints.push(`${hashes.length} edits of ${this.hashes.length} acknowledged ones, or others`);
  }
}

/** The complaints of all since the last time, as one check. */
function report(to, what, writers) {
  const complaints = writers.flatMap((writer) => writer.complaints.splice(0));
  const edits = writers.reduce((sum, writer) => sum + writer.hashes.length, 0);
  to.check(what, complaints.length === 0, complaints[0] ?? `${edits} edits`);
}

async function killed(work, writers, rounds, random, to) {
  let slowest = 0;
  for (let round = 0; round < rounds; ++round) {
    let daemon = await start(work);
    const writing = writers.map((writer) => writer.write(daemon));
    await sleep(50 + random() * 1450);
    await kill(daemon);
    await Promise.all(writing);
    for (let again = 0; again < 3; ++again) {
      const interrupted = await start(work);
      const waking = ask(interrupted.url, "GET", writers[again % writerCount].path);
      await sleep(random() * 40);
      await kill(interrupted);
      await waking;
    }
    daemon = await start(work);
    slowest = Math.max(slowest, daemon.ms);
    await Promise.all(writers.map((writer) => writer.verify(daemon)));
    await kill(daemon);
  }
  report(
    to,
    `kill -9 under load and while coming back, ${rounds} rounds: nothing lost, nothing twice`,
    writers,
  );
  to.check("ready within 5 s of each start", slowest <= 5000, `${slowest} ms`);
}

async function full(work, writers, rounds, random, to) {
  let daemon = await start(work);
  const limit = (bytes) =>
    spawnSync("prlimit", ["--pid", String(daemon.child.pid), `--fsize=${bytes}:unlimited`]).status === 0;
  const wrong = [];
  for (let round = 0; round < rounds; ++round) {
    const writing = writers.map((writer) => writer.write(daemon, 30));
    await sleep(random() * 200);
    if (!limit(4096)) throw new Error("prlimit is missing");
    await sleep(300);
    const { path } = writers[round % writerCount];
    const refused = await ask(daemon.url, "PUT", `${path}/head`, { body: '{"edit":0}', headers: asJson });
    if (refused.status !== 507) wrong.push(`a change answers ${refused.status}`);
    const read = await ask(daemon.url, "GET", `${path}/samples?format=ply`);
    if (read.status !== 200) wrong.push(`reading answers ${read.status}`);
    limit("unlimited");
    await Promise.all(writing);
    await Promise.all(writers.map((writer) => writer.verify(daemon)));
  }
  to.check("a full disk: changes are refused with 507, reading goes on", wrong.length === 0, wrong[0] ?? "");
  report(to, "it ends without a restart, and nothing is lost", writers);
  await kill(daemon);
  daemon = await start(work);
  await Promise.all(writers.map((writer) => writer.verify(daemon)));
  report(to, "nor after one", writers);
  await kill(daemon);
}

async function second(work, to) {
  const daemon = await start(work);
  const begin = Date.now();
  const other = spawnSync(binary, ["--port", "0", "--data", join(work, "data")], { encoding: "utf8" });
  const ms = Date.now() - begin;
  to.check("a second daemon on the folder ends at once", other.status === 1 && ms < 2000, `${ms} ms`);
  to.check("it says why", /in use by another/.test(other.stderr));
  to.check("the first one is unharmed", (await ask(daemon.url, "GET", "/readyz")).status === 200);
  await kill(daemon);
}

async function damaged(work, writers, rounds, random, to) {
  const blobs = join(work, "data/blobs");
  let daemon = await start(work);
  const clouds = documentOf(await ask(daemon.url, "GET", "/v1/clouds")).clouds;
  await kill(daemon);
  const wrong = [];
  for (let round = 0; round < Math.min(rounds, writerCount - 1); ++round) {
    const names = readdirSync(blobs);
    const name = names[Math.floor(random() * names.length)];
    const bytes = readFileSync(join(blobs, name));
    bytes[Math.floor(random() * bytes.length)] ^= 1 << Math.floor(random() * 8);
    writeFileSync(join(blobs, name), round % 2 === 0 ? bytes : bytes.subarray(0, bytes.length - 7));
    const { id } = clouds.find((cloud) => cloud.sha256 === name);
    for (const writer of writers) writer.isHarmed ||= writer.cloud === `/v1/clouds/${id}`;
    daemon = await start(work);
    for (const writer of writers) {
      if (!writer.isHarmed) {
        await writer.verify(daemon);
        continue;
      }
      const answer = await ask(daemon.url, "GET", writer.path);
      if (answer.status !== 409 || documentOf(answer)?.type !== "/problems/damaged")
        wrong.push(`a damaged file answers ${answer.status}`);
    }
    await kill(daemon);
  }
  to.check("a damaged file is told", wrong.length === 0, wrong[0] ?? "");
  report(to, "it takes its own session alone with it", writers);
}

export async function durability({ scale, seed }) {
  const to = new Report("durability: what is acknowledged is there, whatever ends the daemon");
  const rounds = Math.max(2, Math.round(100 * scale));
  const random = randomFrom(seed);
  const work = mkdtempSync(join(tmpdir(), "pointwright-battery-"));
  try {
    const daemon = await start(work);
    const writers = [];
    // Of different sizes: a file for each.
    for (let i = 0; i < writerCount; ++i) writers.push(new Writer(await paintedSession(daemon.url, 30 + i)));
    await kill(daemon);
    await killed(work, writers, rounds, random, to);
    await full(work, writers, Math.ceil(rounds / 3), random, to);
    await second(work, to);
    await damaged(work, writers, rounds, random, to);
  } finally {
    rmSync(work, { recursive: true, force: true });
  }
  return to;
}
