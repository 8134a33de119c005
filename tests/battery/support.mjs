// What the battery's scripts share: raw connections, requests over node's own client, randomness from a seed, a daemon's
// memory and descriptors, and the report.
import { readdirSync, readFileSync } from "node:fs";
import { Agent, request as httpRequest } from "node:http";
import { connect } from "node:net";
import { resolve } from "node:path";
import { root } from "../support/process.mjs";

export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** Numbers in [0, 1) that a seed decides (mulberry32). */
export function randomFrom(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

const agent = new Agent({ keepAlive: false, maxSockets: Number.POSITIVE_INFINITY });
/**
 * One request on a connection of its own. Answers {status, headers, body, ms}; status 0 and `error` where no whole answer
 * came. Never throws.
 */
export function ask(url, method, path, { body, headers = {}, timeout = 30_000 } = {}) {
  const start = performance.now();
  const { hostname, port } = new URL(url);
  return new Promise((done) => {
    const finish = (answer) =>
      done({ ms: performance.now() - start, headers: {}, body: Buffer.alloc(0), ...answer });
    const length = body === undefined ? {} : { "Content-Length": Buffer.byteLength(body) };
    const sent = httpRequest(
      { agent, hostname, port, method, path, headers: { ...length, ...headers }, timeout },
      (answer) => {
        const chunks = [];
        answer.on("data", (chunk) => chunks.push(chunk));
        answer.on("end", () =>
          finish({ status: answer.statusCode, headers: answer.headers, body: Buffer.concat(chunks) }),
        );
        answer.on("error", (error) => finish({ status: 0, error: error.message }));
      },
    );
    sent.on("timeout", () => sent.destroy(new Error("timed out")));
    sent.on("error", (error) => finish({ status: 0, error: error.message }));
    sent.end(body);
  });
}

export const asJson = { "Content-Type": "application/json" };
/** The answer's document; null where it is none. */
export function documentOf(answer) {
  try {
    return JSON.parse(answer.body.toString("utf8"));
  } catch {
    return null;
  }
}

/** A connection to which anything can be written. `read` grows unless it is paused. */
export function rawConnection(url, { paused = false } = {}) {
  const { hostname, port } = new URL(url);
  const socket = connect(Number(port), hostname);
  const connection = { socket, read: "", bytes: 0, isClosed: false };
  socket.setNoDelay(true);
  socket.on("error", () => {});
  socket.on("close", () => (connection.isClosed = true));
  if (paused) socket.pause();
  else
    socket.on("data", (chunk) => {
      connection.bytes += chunk.length;
      if (connection.read.length < 65536) connection.read += chunk.toString("latin1");
    });
  return connection;
}

/** Resident memory of a process in bytes. */
export function residentBytes(pid) {
  const line = readFileSync(`/proc/${pid}/status`, "utf8").match(/^VmRSS:\s+(\d+) kB$/m);
  return line ? Number(line[1]) * 1024 : 0;
}
export const descriptorsOf = (pid) => readdirSync(`/proc/${pid}/fd`).length;
export function isAlive(pid) {
  try {
    return !/^State:\s+Z/m.test(readFileSync(`/proc/${pid}/status`, "utf8"));
  } catch {
    return false;
  }
}

/** Waits until the condition holds, at most so long; answers whether it does. */
export async function comesTrue(condition, ms) {
  const deadline = Date.now() + ms;
  while (!(await condition())) {
    if (Date.now() > deadline) return false;
    await sleep(50);
  }
  return true;
}

export function percentile(values, part) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted.length === 0 ? 0 : sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))];
}

/** The seeds of the fuzz targets, by folder. */
export function corpus(folder) {
  const path = resolve(root, "tests/fuzz/corpus", folder);
  return readdirSync(path)
    .sort()
    .map((name) => ({ name: `${folder}/${name}`, bytes: readFileSync(resolve(path, name)) }));
}

/** The bytes with a few of them changed, cut, doubled, or numbers in them made large. */
export function mutant(bytes, random) {
  let result = Buffer.from(bytes);
  const changes = 1 + Math.floor(random() * 4);
  for (let i = 0; i < changes && result.length > 0; ++i) {
    const at = Math.floor(random() * result.length);
    const kind = random();
    if (kind < 0.4) result[at] = Math.floor(random() * 256);
    else if (kind < 0.55) result[at] ^= 1 << Math.floor(random() * 8);
    else if (kind < 0.7) result = result.subarray(0, at);
    else if (kind < 0.85) {
      const end = Math.min(result.length, at + 1 + Math.floor(random() * 64));
      result = Buffer.concat([result.subarray(0, end), result.subarray(at, end), result.subarray(end)]);
    } else if (at + 4 <= result.length) {
      result.writeUInt32LE([0, 1, 0x7f, 0x7fffffff, 0x80000000, 0xffffffff][Math.floor(random() * 6)], at);
    }
  }
  return result;
}

/** A sheet of side x side samples that rises and falls, as an ASCII PLY file. */
export function wavySheet(side) {
  const lines = [
    "ply",
    "format ascii 1.0",
    `element vertex ${side * side}`,
    "property float x",
    "property float y",
    "property float z",
    "end_header",
  ];
  for (let i = 0; i < side; ++i)
    for (let j = 0; j < side; ++j) {
      const [x, y] = [i / (side - 1), j / (side - 1)];
      lines.push(`${x.toFixed(6)} ${y.toFixed(6)} ${(0.05 * Math.sin(12 * x) * Math.cos(9 * y)).toFixed(6)}`);
    }
  return `${lines.join("\n")}\n`;
}

/** A cloud of side x side samples and a session on it, both ends painted and ready; answers their paths. */
export async function paintedSession(url, side = 60) {
  const uploaded = await ask(url, "POST", "/v1/clouds?name=sheet", {
    body: wavySheet(side),
    headers: { "Content-Type": "application/x-ply" },
  });
  if (uploaded.status !== 201) throw new Error(`the upload answered ${uploaded.status}: ${uploaded.body}`);
  const cloud = documentOf(uploaded).id;
  const made = await ask(url, "POST", "/v1/sessions", {
    body: JSON.stringify({ cloud, scales: [0.05] }),
    headers: asJson,
  });
  if (made.status !== 202) throw new Error(`the session answered ${made.status}: ${made.body}`);
  const path = made.headers.location;
  await comesTrue(async () => documentOf(await ask(url, "GET", path))?.state === "ready", 60_000);
  for (const [region, min, max] of [
    ["zero", -1, 0.2],
    ["one", 0.8, 2],
  ]) {
    const shape = { type: "box", min: [min, -1, -1], max: [max, 2, 1] };
    const painted = await ask(url, "POST", `${path}/regions/${region}/operations`, {
      body: JSON.stringify({ mode: "add", shape }),
      headers: asJson,
    });
    if (painted.status !== 200) throw new Error(`painting answered ${painted.status}: ${painted.body}`);
  }
  return { cloud: `/v1/clouds/${cloud}`, path };
}

/** An edit that lifts the one-region. */
export const lift = (z) =>
  JSON.stringify({ level: 0, blend: "quartic", deformation: { type: "translation", vector: [0, 0, z] } });

/** What a script found: each check once, with what was measured. */
export class Report {
  failed = 0;
  passed = 0;
  constructor(name) {
    console.log(name);
  }
  check(what, holds, measured = "") {
    if (holds) this.passed += 1;
    else this.failed += 1;
    console.log(`  ${holds ? "ok    " : "FAILED"} ${what}${measured === "" ? "" : `: ${measured}`}`);
  }
}
