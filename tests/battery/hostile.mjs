// Hostile bytes: mutated files and documents. The daemon stays the same process, answers each with a 4xx that says why (or
// takes what is still a cloud), keeps its memory and its state, and goes on serving.
import { startDaemon } from "../../web/demo/daemon.mjs";
import {
  asJson,
  ask,
  corpus,
  documentOf,
  isAlive,
  lift,
  mutant,
  paintedSession,
  percentile,
  Report,
  randomFrom,
  residentBytes,
} from "./support.mjs";

const mebi = 1024 * 1024;

/** Runs `work` on `count` items, eight at once. */
async function eightAtOnce(count, work) {
  let next = 0;
  const worker = async () => {
    while (next < count) await work(next++);
  };
  await Promise.all(Array.from({ length: 8 }, worker));
}

/** Uploads mutants of the corpus. */
async function uploads(report, daemon, count, random) {
  const seeds = ["draco", "draco_tiles", "ply", "xyz", "obj", "pcd", "las"].flatMap((folder) => {
    try {
      return corpus(folder);
    } catch {
      return [];
    }
  });
  const before = residentBytes(daemon.pid);
  const answers = { ok: 0, refused: 0, busy: 0 };
  const times = [];
  const wrong = [];
  await eightAtOnce(count, async () => {
    const seed = seeds[Math.floor(random() * seeds.length)];
    const body = mutant(seed.bytes, random);
    const answer = await ask(daemon.url, "POST", "/v1/clouds?name=mutant", {
      body,
      headers: { "Content-Type": "application/octet-stream" },
    });
    times.push(answer.ms);
    const document = documentOf(answer);
    if (answer.status === 201) {
      answers.ok += 1;
      const bounds = document && [...document.bounds.min, ...document.bounds.max];
      if (!bounds?.every(Number.isFinite) || document.sample_count < 0)
        wrong.push(`${seed.name}: ${answer.body}`);
      await ask(daemon.url, "DELETE", answer.headers.location);
    } else if (answer.status >= 400 && answer.status < 500 && document?.type && document?.detail)
      answers.refused += 1;
    else if (answer.status === 503 && answer.headers["retry-after"]) answers.busy += 1;
    else wrong.push(`${seed.name}: ${answer.status} ${answer.error ?? answer.body}`);
  });
  report.check(
    `${count} mutated uploads answered`,
    wrong.length === 0,
    wrong.slice(0, 3).join("; ") || JSON.stringify(answers),
  );
  report.check(
    "the slowest answer is within 5 s",
    Math.max(...times) < 5000,
    `${Math.max(...times).toFixed(0)} ms`,
  );
  report.check(
    "99 % of the answers are within a second",
    percentile(times, 0.99) < 1000,
    `${percentile(times, 0.99).toFixed(0)} ms`,
  );
  const grown = (residentBytes(daemon.pid) - before) / mebi;
  report.check("memory grows by less than 64 MiB", grown < 64, `${grown.toFixed(1)} MiB`);
  const left = documentOf(await ask(daemon.url, "GET", "/v1/clouds"));
  report.check(
    "nothing is stored but what was there",
    left.clouds.length === 1,
    `${left.clouds.length} clouds`,
  );
}

const poison = [
  null,
  true,
  -1,
  1e300,
  -0.0,
  4294967297,
  1.9,
  "",
  "\u0000",
  "x".repeat(1000),
  [],
  {},
  [[[[]]]],
  [1, 2],
  [1, 2, 3, 4],
  { type: "sphere" },
  [1e308, 1e308, 1e308],
];

/** The document with one value somewhere replaced, left out, or a member added. */
function spoiled(document, random) {
  const copy = structuredClone(document);
  const places = [];
  const visit = (value) => {
    if (value === null || typeof value !== "object") return;
    for (const key of Object.keys(value)) {
      places.push([value, key]);
      visit(value[key]);
    }
  };
  visit(copy);
  const [holder, key] = places[Math.floor(random() * places.length)];
  const kind = random();
  if (kind < 0.7) holder[key] = poison[Math.floor(random() * poison.length)];
  else if (kind < 0.85) {
    if (Array.isArray(holder)) holder.splice(Number(key), 1);
    else delete holder[key];
  } else if (!Array.isArray(holder)) holder.surprise = 1;
  return JSON.stringify(copy);
}

/** Texts that are no documents, or too much of one. */
const texts = (limit) => [
  "",
  "{",
  "[1,]",
  '{"a":NaN}',
  '{"a":Infinity}',
  '{"level":0,"level":1}',
  `${"[".repeat(33)}${"]".repeat(33)}`,
  "[".repeat(100_000),
  Buffer.from([0x7b, 0x22, 0xff, 0xfe, 0x22, 0x3a, 0x31, 0x7d]),
  `"${"a".repeat(limit)}"`,
];

/** Spoiled documents on every route that takes one. */
async function documents(report, daemon, session, count, random) {
  const sphere = { mode: "add", shape: { type: "sphere", center: [0.5, 0.5, 0], radius: 0.1 } };
  const edit = JSON.parse(lift(0.1));
  const routes = [
    ["POST", "/v1/sessions", { cloud: "AAAAAAAAAAAAAAAAAAAAAA", scales: [0.05], name: "s" }],
    ["PATCH", session.path, { name: 5 }],
    ["POST", `${session.path}/regions/one/operations`, sphere],
    ["PUT", `${session.path}/regions/one`, { operations: [sphere] }],
    ["POST", `${session.path}/preview`, { ...edit, sequence: 1 }],
    ["POST", `${session.path}/edits`, edit],
    ["PUT", `${session.path}/edits/1`, edit],
    ["PUT", `${session.path}/head`, { edit: 77 }],
    [
      "POST",
      `${session.path}/recipe`,
      { recipe: { format: "pointwright-recipe", version: 1, level_scales: [1, 0], edits: [{ edit }] } },
    ],
  ];
  const before = documentOf(await ask(daemon.url, "GET", session.path));
  // Every change is asked for on a revision that never was: what is not refused for itself is refused for that.
  const headers = { ...asJson, "If-Match": '"r999999"' };
  const wrong = [];
  const send = async (method, path, body) => {
    const answer = await ask(daemon.url, method, path, { body, headers });
    const fine = answer.status >= 400 && answer.status < 500 && documentOf(answer)?.type;
    const isPreview = path.endsWith("/preview") && answer.status === 200;
    if (!fine && !isPreview)
      wrong.push(`${method} ${path}: ${answer.status} ${answer.error ?? answer.body.subarray(0, 200)}`);
  };
  await eightAtOnce(count, async () => {
    const [method, path, document] = routes[Math.floor(random() * routes.length)];
    await send(method, path, spoiled(document, random));
  });
  for (const [method, path] of routes)
    for (const text of texts(33 * mebi)) {
      const answer = await ask(daemon.url, method, path, { body: text, headers });
      // A body beyond the limit is refused from its head: its sender may be cut off before the answer is read.
      const cut = answer.status === 0 && text.length > mebi;
      if (!cut && !(answer.status >= 400 && answer.status < 500))
        wrong.push(`${method} ${path} ${String(text).slice(0, 30)}: ${answer.status} ${answer.error ?? ""}`);
    }
  report.check(`${count} spoiled documents refused`, wrong.length === 0, wrong.slice(0, 3).join("; "));
  const after = documentOf(await ask(daemon.url, "GET", session.path));
  const same = JSON.stringify({ ...before, timings_ms: 0 }) === JSON.stringify({ ...after, timings_ms: 0 });
  report.check("the session is as it was", same, same ? `revision ${after.revision}` : JSON.stringify(after));
}

/** Other hosts, other origins, other types of bodies, on whatever changes state. */
async function strangers(report, daemon, session) {
  const routes = [
    ["POST", "/v1/clouds"],
    ["POST", "/v1/sessions"],
    ["POST", `${session.path}/edits`],
    ["POST", `${session.path}/regions/one/operations`],
    ["PUT", `${session.path}/head`],
    ["DELETE", session.path],
    ["DELETE", session.cloud],
  ];
  const ways = [
    { Host: "evil.example" },
    { Host: "127.0.0.1.evil.example" },
    { Host: "localhost.evil.example:80" },
    { Host: "" },
    { Origin: "http://evil.example" },
    { Origin: "null" },
    { Origin: `${daemon.url}.evil.example` },
  ];
  const wrong = [];
  for (const [method, path] of routes)
    for (const way of ways) {
      const answer = await ask(daemon.url, method, path, { body: "{}", headers: { ...asJson, ...way } });
      if (!(answer.status >= 400 && answer.status < 500))
        wrong.push(`${method} ${path} ${JSON.stringify(way)}: ${answer.status}`);
    }
  for (const [method, path] of routes.filter(([method]) => method !== "DELETE"))
    for (const type of ["application/x-www-form-urlencoded", "multipart/form-data; boundary=x"]) {
      const answer = await ask(daemon.url, method, path, { body: "a=1", headers: { "Content-Type": type } });
      if (!(answer.status >= 400 && answer.status < 500))
        wrong.push(`${method} ${path} as ${type}: ${answer.status}`);
    }
  report.check(
    "foreign hosts, origins and forms are refused",
    wrong.length === 0,
    wrong.slice(0, 3).join("; "),
  );
  report.check("and changed nothing", (await ask(daemon.url, "GET", session.path)).status === 200);
}

export async function hostile({ scale, seed }) {
  const report = new Report("hostile bytes");
  const random = randomFrom(seed);
  const daemon = await startDaemon();
  try {
    const session = await paintedSession(daemon.url);
    await uploads(report, daemon, Math.ceil(20_000 * scale), random);
    await documents(report, daemon, session, Math.ceil(5_000 * scale), random);
    await strangers(report, daemon, session);
    const edit = await ask(daemon.url, "POST", `${session.path}/edits`, {
      body: lift(0.1),
      headers: { ...asJson, "If-Match": "*" },
    });
    report.check("an honest edit works afterwards", edit.status === 201, `${edit.ms.toFixed(0)} ms`);
    report.check("it is the same process", isAlive(daemon.pid));
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
