// What the service carries: requests a second and their tail, frames a second on each of many streams, sessions held. One
// daemon on loopback, its clients on the same machine: they take their part of it.
//
//   node tests/bench/load.mjs [--out build/bench-load.json]
import { writeFileSync } from "node:fs";
import { availableParallelism, cpus } from "node:os";
import { parseArgs } from "node:util";
import { startDaemon } from "../../web/demo/daemon.mjs";
import {
  asJson,
  ask,
  lift,
  paintedSession,
  percentile,
  rawConnection,
  residentBytes,
} from "../battery/support.mjs";

const { values } = parseArgs({ options: { out: { type: "string" } } });
const rows = [];
function put(name, value, unit, n) {
  rows.push({ name, value, unit, n, threads: availableParallelism?.() ?? cpus().length });
  console.log(`${name.padEnd(38)} ${value.toFixed(3).padStart(10)} ${unit.padEnd(12)} n = ${n}`);
}

/** Runs `clients` loops of `work` for so long; answers the times of all calls and how many there were a second. */
async function loops(clients, ms, work) {
  const times = [];
  const start = performance.now();
  await Promise.all(
    Array.from({ length: clients }, async (_, client) => {
      for (let i = 0; performance.now() - start < ms; ++i) times.push(await work(client, i));
    }),
  );
  return { times, perSecond: (1000 * times.length) / (performance.now() - start) };
}

async function timed(url, method, path, body) {
  const headers = body === undefined ? {} : { ...asJson, "If-Match": "*" };
  const answer = await ask(url, method, path, { body, headers });
  if (answer.status === 0 || answer.status >= 400)
    throw new Error(`${method} ${path} answered ${answer.status} ${answer.error ?? answer.body}`);
  return answer.ms;
}

function putTail(name, { times, perSecond }, n) {
  put(`${name}.per_s`, perSecond, "1/s", n);
  put(`${name}.p50`, percentile(times, 0.5), "ms", n);
  put(`${name}.p99`, percentile(times, 0.99), "ms", n);
}

/** Frames that reach each of `count` streams a second while one hand drags as fast as it is answered. */
async function streams(url, session, count, ms) {
  const readers = Array.from({ length: count }, () => {
    const reader = { ...rawConnection(url, { paused: true }), frames: 0 };
    let tail = "";
    reader.socket.on("data", (chunk) => {
      const text = tail + chunk.toString("latin1");
      for (let at = text.indexOf("PWFR"); at >= 0; at = text.indexOf("PWFR", at + 4)) reader.frames += 1;
      tail = text.slice(-3);
    });
    reader.socket.resume();
    reader.socket.write(
      `GET ${session.path}/stream?attributes=normal HTTP/1.1\r\nHost: ${new URL(url).host}\r\n\r\n`,
    );
    return reader;
  });
  let sequence = 0;
  const drag = await loops(1, ms, async (_, i) => {
    sequence += 1;
    const edit = { ...JSON.parse(lift(0.001 * (1 + (i % 50)))), sequence };
    return timed(url, "PUT", `${session.path}/preview`, JSON.stringify(edit));
  });
  const perSecond = readers.map(({ frames }) => (1000 * frames) / ms);
  for (const { socket } of readers) socket.destroy();
  await ask(url, "DELETE", `${session.path}/preview`);
  return { drag, perSecond };
}

const daemon = await startDaemon(["--max-streams", "512", "--max-sessions", "1000", "--max-clouds", "64"]);
try {
  const side = 100;
  const n = side * side;
  const sessions = [];
  for (let i = 0; i < 8; ++i) sessions.push(await paintedSession(daemon.url, side));
  await loops(8, 1000, (client) => timed(daemon.url, "GET", sessions[client].path));
  for (const clients of [1, 8, 64]) {
    putTail(
      `load.get.c${clients}`,
      await loops(clients, 4000, (client) => timed(daemon.url, "GET", sessions[client % 8].path)),
      n,
    );
    putTail(
      `load.edit.c${clients}`,
      await loops(clients, 4000, (client, i) =>
        timed(daemon.url, "POST", `${sessions[client % 8].path}/edits`, lift(i % 2 ? 0.001 : -0.001)),
      ),
      n,
    );
    const { drag, perSecond } = await streams(daemon.url, sessions[0], clients, 4000);
    put(`load.stream.c${clients}.frames_per_s`, percentile(perSecond, 0.5), "1/s", n);
    put(`load.stream.c${clients}.least`, Math.min(...perSecond), "1/s", n);
    put(`load.stream.c${clients}.preview_p99`, percentile(drag.times, 0.99), "ms", n);
  }
  const before = residentBytes(daemon.pid);
  const more = 50;
  for (let i = 0; i < more; ++i) {
    const made = await ask(daemon.url, "POST", "/v1/sessions", {
      body: JSON.stringify({ cloud: sessions[0].cloud.split("/").at(-1), scales: [0.05] }),
      headers: asJson,
    });
    if (made.status !== 202) throw new Error(`session ${i} answered ${made.status}: ${made.body}`);
    while (JSON.parse((await ask(daemon.url, "GET", made.headers.location)).body).state === "building");
  }
  put("load.session.bytes_per_sample", (residentBytes(daemon.pid) - before) / more / n, "B", n);
} finally {
  await daemon.stop();
}
if (values.out) writeFileSync(values.out, `${JSON.stringify(rows, null, 1)}\n`);
