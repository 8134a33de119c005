// Many honest clients: 10,000 requests from 64 of them without a 5xx, then more than can be served, then as before.
import { startDaemon } from "../../web/demo/daemon.mjs";
import {
  asJson,
  ask,
  comesTrue,
  descriptorsOf,
  lift,
  paintedSession,
  percentile,
  Report,
} from "./support.mjs";

/** What clients do, by turns. */
const requests = (session) => [
  ["GET", "/v1/info"],
  ["GET", session.path],
  ["GET", `${session.path}/edits`],
  ["GET", `${session.path}/samples?format=frame&attributes=normal,t`],
  ["POST", `${session.path}/edits`, lift(0.001)],
  ["GET", `${session.cloud}/data?format=draco`],
  ["PUT", `${session.path}/head`, JSON.stringify({ edit: 0 })],
  ["POST", `${session.path}/preview`, JSON.stringify({ ...JSON.parse(lift(0.1)), sequence: 7 })],
];

/** `count` requests from `clients` clients; answers times and what was not answered well. */
async function run(url, sessions, clients, count) {
  const times = [];
  const wrong = [];
  let next = 0;
  const start = performance.now();
  await Promise.all(
    Array.from({ length: clients }, async (_, client) => {
      const list = requests(sessions[client % sessions.length]);
      while (next < count) {
        const [method, path, body] = list[next++ % list.length];
        const headers = body === undefined ? {} : { ...asJson, "If-Match": "*" };
        const answer = await ask(url, method, path, { body, headers });
        times.push(answer.ms);
        if (answer.status === 0 || answer.status >= 500)
          wrong.push(`${method} ${path}: ${answer.status} ${answer.error ?? answer.body}`);
      }
    }),
  );
  return { times, wrong, perSecond: (1000 * count) / (performance.now() - start) };
}

export async function load({ scale }) {
  const report = new Report("many clients");
  const daemon = await startDaemon();
  try {
    const sessions = [];
    for (let i = 0; i < 4; ++i) sessions.push(await paintedSession(daemon.url, 100));
    await run(daemon.url, sessions, 8, 200);
    const before = descriptorsOf(daemon.pid);
    const count = Math.ceil(10_000 * scale);
    const { times, wrong, perSecond } = await run(daemon.url, sessions, 64, count);
    report.check(
      `${count} requests from 64 clients without a 5xx`,
      wrong.length === 0,
      wrong.slice(0, 3).join("; ") ||
        `${perSecond.toFixed(0)} a second, p50 ${percentile(times, 0.5).toFixed(0)} ms, p99 ${percentile(times, 0.99).toFixed(0)} ms`,
    );
    const back = await comesTrue(() => Math.abs(descriptorsOf(daemon.pid) - before) <= 8, 60_000);
    report.check("descriptors come back", back, `${before} before, ${descriptorsOf(daemon.pid)} after`);
    const again = await run(daemon.url, sessions, 8, Math.ceil(count / 5));
    report.check(
      "afterwards eight clients wait no longer than eight should",
      percentile(again.times, 0.99) < Math.max(1000, percentile(times, 0.99)),
      `p99 ${percentile(again.times, 0.99).toFixed(0)} ms`,
    );
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
