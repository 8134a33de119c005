// Clients that are slow, vanish, announce too much or never read: nobody else waits, nothing stays behind.
import { startDaemon } from "../../web/demo/daemon.mjs";
import {
  asJson,
  ask,
  comesTrue,
  descriptorsOf,
  documentOf,
  lift,
  paintedSession,
  percentile,
  Report,
  randomFrom,
  rawConnection,
  residentBytes,
  sleep,
  wavySheet,
} from "./support.mjs";

const mebi = 1024 * 1024;
const host = (url) => `Host: ${new URL(url).host}\r\n`;

/** Times of health checks and of edits, one after the other, for so long. */
async function honestClient(url, session, ms) {
  const health = [];
  const edits = [];
  const failures = [];
  const end = Date.now() + ms;
  for (let i = 0; Date.now() < end; ++i) {
    const alive = await ask(url, "GET", "/healthz");
    health.push(alive.ms);
    const edit = await ask(url, "POST", `${session.path}/edits`, {
      body: lift(i % 2 === 0 ? 0.01 : -0.01),
      headers: { ...asJson, "If-Match": "*" },
    });
    edits.push(edit.ms);
    if (alive.status !== 200) failures.push(`health ${alive.status} ${alive.error ?? ""}`);
    if (edit.status !== 201) failures.push(`edit ${edit.status} ${edit.error ?? edit.body}`);
    await sleep(20);
  }
  return { health, edits, failures };
}

/** Slow heads, idle connections and streams that nobody reads, all at once. */
async function crowd(report, daemon, session, seconds) {
  const { url } = daemon;
  const alone = await honestClient(url, session, 3000);
  const before = residentBytes(daemon.pid);
  const slow = Array.from({ length: 200 }, () => rawConnection(url));
  const idle = Array.from({ length: 300 }, () => rawConnection(url));
  const unread = Array.from({ length: 64 }, () => rawConnection(url, { paused: true }));
  for (const { socket } of unread) socket.write(`GET ${session.path}/stream HTTP/1.1\r\n${host(url)}\r\n`);
  const drip = setInterval(() => {
    for (const { socket } of slow) socket.write("G");
  }, 1000);
  const together = await honestClient(url, session, seconds * 1000);
  clearInterval(drip);
  report.check(
    "an honest client is served throughout",
    together.failures.length === 0,
    together.failures.slice(0, 3).join("; "),
  );
  report.check(
    "health checks stay below 2 s",
    Math.max(...together.health) < 2000,
    `${Math.max(...together.health).toFixed(0)} ms`,
  );
  const [p99, p99Alone] = [percentile(together.edits, 0.99), percentile(alone.edits, 0.99)];
  report.check(
    "edits are at most three times as slow",
    p99 < Math.max(3 * p99Alone, 100),
    `p99 ${p99.toFixed(0)} ms, alone ${p99Alone.toFixed(0)} ms`,
  );
  const grown = (residentBytes(daemon.pid) - before) / mebi;
  report.check("unread streams hold no frames back", grown < 64 + 64, `${grown.toFixed(1)} MiB`);
  const dropped = await comesTrue(() => [...slow, ...idle].every(({ isClosed }) => isClosed), 20_000);
  report.check("slow and idle connections are closed", dropped);
  for (const { socket } of [...slow, ...idle, ...unread]) socket.destroy();
}

/** Uploads that are cut at a random byte, by a plain end or a reset. */
async function cutUploads(report, daemon, count, random) {
  const body = wavySheet(40);
  const before = descriptorsOf(daemon.pid);
  for (let i = 0; i < count; i += 50) {
    await Promise.all(
      Array.from({ length: Math.min(50, count - i) }, async () => {
        const { socket } = rawConnection(daemon.url);
        const text = `POST /v1/clouds?name=cut HTTP/1.1\r\n${host(daemon.url)}Content-Type: application/x-ply\r\nContent-Length: ${body.length}\r\n\r\n${body}`;
        const cut = Math.floor(random() * (text.length - 1));
        const reset = random() < 0.5;
        await new Promise((done) => {
          socket.on("close", done);
          socket.write(
            text.slice(0, cut),
            () => (reset ? socket.resetAndDestroy?.() : socket.end()) ?? socket.destroy(),
          );
        });
      }),
    );
  }
  const back = await comesTrue(() => Math.abs(descriptorsOf(daemon.pid) - before) <= 8, 60_000);
  report.check(
    `descriptors come back after ${count} cut uploads`,
    back,
    `${before} before, ${descriptorsOf(daemon.pid)} after`,
  );
  const { clouds } = documentOf(await ask(daemon.url, "GET", "/v1/clouds"));
  report.check(
    "none of them is stored",
    clouds.every(({ name }) => name !== "cut"),
  );
}

/** Streams that are cut and opened again: each begins with a key frame, and none stays open. */
async function cutStreams(report, daemon, session, count, random) {
  const before = descriptorsOf(daemon.pid);
  let keys = 0;
  for (let i = 0; i < count; i += 25) {
    await Promise.all(
      Array.from({ length: Math.min(25, count - i) }, async () => {
        const stream = rawConnection(daemon.url);
        stream.socket.write(`GET ${session.path}/stream HTTP/1.1\r\n${host(daemon.url)}\r\n`);
        await comesTrue(() => stream.read.includes("PWFR") || stream.isClosed, 20_000);
        const at = stream.read.indexOf("PWFR");
        if (at >= 0 && stream.read.charCodeAt(at + 12) === 0) keys += 1;
        await sleep(random() * 50);
        stream.socket.destroy();
      }),
    );
  }
  report.check(`${count} streams each began with a key frame`, keys === count, `${keys}`);
  const back = await comesTrue(() => Math.abs(descriptorsOf(daemon.pid) - before) <= 8, 60_000);
  report.check(
    "descriptors come back after cut streams",
    back,
    `${before} before, ${descriptorsOf(daemon.pid)} after`,
  );
}

/** Bodies that are announced as larger than may be: refused from the head, with next to nothing read. */
async function tooLarge(report, daemon) {
  const answers = await Promise.all(
    Array.from({ length: 20 }, async () => {
      const upload = rawConnection(daemon.url);
      upload.socket.write(
        `POST /v1/clouds?name=big HTTP/1.1\r\n${host(daemon.url)}Content-Type: application/x-ply\r\nContent-Length: 4294967296\r\n\r\n`,
      );
      const junk = Buffer.alloc(65536);
      let sent = 0;
      const pump = setInterval(() => {
        if (!upload.isClosed && upload.socket.write(junk)) sent += junk.length;
      }, 5);
      await comesTrue(() => upload.read.includes("\r\n\r\n") || upload.isClosed, 10_000);
      clearInterval(pump);
      upload.socket.destroy();
      return { status: upload.read.slice(9, 12), sent };
    }),
  );
  report.check(
    "uploads announced with 4 GiB are refused from the head",
    answers.every(({ status }) => status === "413"),
    answers[0].status,
  );
}

export async function connections({ scale, seed }) {
  const report = new Report("clients that are slow or vanish");
  const random = randomFrom(seed + 1);
  const daemon = await startDaemon();
  try {
    const session = await paintedSession(daemon.url);
    await crowd(report, daemon, session, Math.max(5, 60 * scale));
    await cutUploads(report, daemon, Math.ceil(1000 * scale), random);
    await cutStreams(report, daemon, session, Math.ceil(500 * scale), random);
    await tooLarge(report, daemon);
  } finally {
    const status = await daemon.stop();
    report.check(
      "it stops in order",
      status === 0,
      status === 0 ? "" : `${status}\n${daemon.log().slice(-2000)}`,
    );
  }
  return report;
}
