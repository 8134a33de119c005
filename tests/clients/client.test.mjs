// The typed client, built as a package, in Node against the real daemon; and the example of its README.
import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { after, before, test } from "node:test";
import { startDaemon } from "../../web/demo/daemon.mjs";
import { root, run } from "../support/process.mjs";

let daemon;
let pointwright;
const folder = mkdtempSync(join(tmpdir(), "pointwright-client-"));

/** A wavy sheet over the unit square as a binary PLY file. */
function sheet(side) {
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex ${side * side}\nproperty float x\nproperty float y\nproperty float z\nend_header\n`;
  const body = new Float32Array(3 * side * side);
  for (let i = 0; i < side * side; i++) {
    const [x, y] = [(i % side) / (side - 1), Math.floor(i / side) / (side - 1)];
    body.set([x, y, 0.02 * Math.sin(20 * x) * Math.cos(17 * y)], 3 * i);
  }
  return Buffer.concat([Buffer.from(head, "latin1"), Buffer.from(body.buffer)]);
}

before(async () => {
  const built = await run("node", ["web/scripts/client.mjs"]);
  assert.equal(built.status, 0, built.output);
  pointwright = await import("../../clients/typescript/dist/pointwright.js");
  daemon = await startDaemon();
});
after(async () => {
  await daemon?.stop();
  rmSync(folder, { recursive: true, force: true });
});

test("the package holds no viewer", () => {
  const bundle = readFileSync(resolve(root, "clients/typescript/dist/pointwright.js"), "utf8");
  assert.doesNotMatch(bundle, /document\.|WebGL|three/);
  assert.ok(bundle.length < 64 * 1024, `${bundle.length} bytes`);
});

test("a cloud is uploaded, painted, edited and watched", async () => {
  const { ApiClient, SessionStream, lanePosition, uploadBytes, waitForSession, withToken } = pointwright;
  const seen = [];
  const client = new ApiClient(
    daemon.url,
    withToken("secret", (input, init) => {
      seen.push(new Headers(init.headers).get("Authorization"));
      return fetch(input, init);
    }),
  );
  const cloud = await uploadBytes(client, "sheet.ply", sheet(30), { dropNonFinite: true });
  assert.equal(cloud.sample_count, 900);
  assert.deepEqual(new Set(seen), new Set(["Bearer secret"]));
  const phases = [];
  const { id } = await client.createSession(cloud.id, { scales: [0.05] });
  const ready = await waitForSession(client, id, { onProgress: (phase) => phases.push(phase) });
  assert.equal(ready.state, "ready");
  assert.equal(phases.at(-1), ready.progress.phase);

  const box = (min, max) => ({ mode: "add", shape: { type: "box", min, max } });
  await client.addOperation(id, "zero", box([-1, -1, -1], [0.2, 2, 1]));
  const painted = await client.addOperation(id, "one", box([0.8, -1, -1], [2, 2, 1]));
  assert.equal(painted.changed, 6 * 30);

  const tops = [];
  const events = [];
  let top = Number.NEGATIVE_INFINITY;
  const sink = {
    frameBegin: () => {
      top = Number.NEGATIVE_INFINITY;
    },
    frameBlock: (block, header) => {
      for (let lane = 0; lane < block.count; lane++)
        top = Math.max(top, header.origin[2] + lanePosition(block, lane)[2]);
    },
    frameEnd: (header) => tops.push([header.revision, top]),
    event: (event) => events.push(event.event),
  };
  const ended = new Promise((done) => {
    const stream = new SessionStream(client, id, sink, {
      onState: (state) => state === "lost" && done(),
      mayRetry: () => false,
    });
    stream.start();
    const poll = setInterval(() => {
      if (!tops.some(([revision]) => revision === 3)) return;
      clearInterval(poll);
      stream.stop();
      done();
    }, 10);
  });
  const edit = { level: 0, deformation: { type: "translation", vector: [0, 0, 0.4] } };
  const record = await client.commitEdit(id, edit, painted.revision);
  assert.equal(record.index, 1);
  await ended;
  assert.equal(events[0], "session");
  assert.ok(tops.at(-1)[1] > 0.35, JSON.stringify(tops));
  assert.deepEqual((await client.putHead(id, 0, 3)).history, { head: 0, edits: 1 });
  await assert.rejects(client.putHead(id, 9, 4), (error) => error.status === 422);
  await client.deleteSession(id);
  await client.deleteCloud(cloud.id);
  await assert.rejects(client.session(id), (error) => error.problem.type === "/problems/not-found");
});

test("the README's example runs", async () => {
  const text = readFileSync(resolve(root, "clients/typescript/README.md"), "utf8");
  const example = text.match(/^```js\n([\s\S]*?)^```$/m)?.[1];
  assert.ok(example);
  mkdirSync(join(folder, "node_modules"));
  symlinkSync(resolve(root, "clients/typescript"), join(folder, "node_modules/pointwright-client"));
  writeFileSync(join(folder, "scan.ply"), sheet(30));
  writeFileSync(join(folder, "example.mjs"), example.replaceAll("http://127.0.0.1:8080", daemon.url));
  const { status, output } = await run("node", ["example.mjs"], { cwd: folder, timeoutSeconds: 120 });
  assert.equal(status, 0, output);
  assert.match(output, /900 samples in /);
  assert.match(output, /412 \/problems\/stale-revision 3/);
  assert.equal(readFileSync(join(folder, "edited.ply")).subarray(0, 4).toString(), "ply\n");
});

test("the package's types hold for its users", async () => {
  writeFileSync(
    join(folder, "user.ts"),
    `import { ApiClient, type CloudDocument, decodeFrame } from "pointwright-client";
     const client = new ApiClient("http://127.0.0.1/");
     export const count: Promise<number> = client.clouds().then((all: CloudDocument[]) => all[0]?.sample_count ?? 0);
     // @ts-expect-error a vector has three numbers
     void client.commitEdit("id", { level: 0, deformation: { type: "translation", vector: [0, 0] } }, 1);
     export const level: number = decodeFrame(new Uint8Array(0)).header.level;`,
  );
  const compilerOptions = {
    noEmit: true,
    strict: true,
    target: "es2022",
    module: "esnext",
    moduleResolution: "bundler",
    lib: ["es2022", "dom", "dom.iterable"],
    types: [],
  };
  writeFileSync(join(folder, "tsconfig.json"), JSON.stringify({ compilerOptions, files: ["user.ts"] }));
  const { status, output } = await run(
    "node",
    [resolve(root, "web/node_modules/typescript/bin/tsc"), "-p", "."],
    { cwd: folder },
  );
  assert.equal(status, 0, output);
});
