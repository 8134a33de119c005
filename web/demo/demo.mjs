// The demonstration: turns the Stanford dragon's head through the public HTTP API, checks the result against what was
// asked for, and takes pictures with the real viewer. `make demo` builds what it needs and runs it.
import { mkdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import {
  ApiClient,
  decodeFrame,
  demand,
  download,
  here,
  openSession,
  root,
  say,
  step,
  takePicture,
  uploadBytes,
} from "./api.mjs";
import { putTogether } from "./beside.mjs";
import { startDaemon } from "./daemon.mjs";
import { oneOperations, regionOf, turn, zeroOperations } from "./dragon.mjs";
import { readPly } from "./ply.mjs";
import { fitRigidMotion } from "./rigid.mjs";

const out = resolve(root, "build/demo");
const dragon = resolve(root, "build/data/dragon.drc");
const angleDeg = 40;
const previewCount = 12;
const camera = { position: [-0.045, 0.165, 0.285], target: [-0.006, 0.124, 0], up: [0, 1, 0] };

const megabytes = (bytes) => `${(bytes / 1e6).toFixed(1)} MB`;
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

/** One preview as a tool asks for it: the parameters go, the exact frame comes back. Answers its milliseconds and bytes. */
async function preview(client, id, sequence, revision) {
  const start = performance.now();
  const response = await client.request(`v1/sessions/${id}/preview?attributes=normal,t`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ ...turn((angleDeg * sequence) / previewCount), sequence }),
  });
  const bytes = new Uint8Array(await response.arrayBuffer());
  const ms = performance.now() - start;
  const { header } = decodeFrame(bytes);
  demand(header.revision === revision, "the frame shows another revision");
  demand(header.sequence === sequence, "the frame shows another preview");
  return { ms, bytes: bytes.length };
}

/** Compares the download with the upload. Answers what to say; throws where the edit is not the one that was asked for. */
function verify(before, after, diagonal) {
  demand(before.count === after.count, `${before.count} samples went in, ${after.count} came out`);
  demand(after.positions.every(Number.isFinite), "the result has samples that are not finite");
  const samples = { zero: [], one: [], free: [] };
  const p = [0, 0, 0];
  for (let i = 0; i < before.count; i++) {
    for (let axis = 0; axis < 3; axis++) p[axis] = before.positions[3 * i + axis];
    samples[regionOf(p, 1e-6 * diagonal)]?.push(i);
  }
  const moved = samples.zero.filter((i) =>
    [0, 1, 2].some((k) => !Object.is(before.positions[3 * i + k], after.positions[3 * i + k])),
  );
  demand(samples.zero.length > 0, "no sample lies in the zero-region");
  demand(
    moved.length === 0,
    `${moved.length} of ${samples.zero.length} samples of the zero-region have moved`,
  );

  const { deformation } = turn(angleDeg);
  const length = Math.hypot(...deformation.axis.direction);
  const motion = fitRigidMotion(before.positions, after.positions, samples.one);
  const cosine = motion.axis.reduce(
    (sum, value, i) => sum + (value * deformation.axis.direction[i]) / length,
    0,
  );
  const tiltDeg = (Math.acos(Math.min(1, cosine)) * 180) / Math.PI;
  demand(
    Math.abs(motion.angleDeg - angleDeg) < 0.01,
    `the head turned by ${motion.angleDeg}°, not by ${angleDeg}°`,
  );
  demand(tiltDeg < 0.01, `the head turned about an axis that is off by ${tiltDeg}°`);
  demand(
    motion.max < 1e-5 * diagonal,
    `the head is bent: up to ${motion.max / diagonal} of the diagonal from a rigid motion`,
  );
  return (
    `${samples.zero.length} samples of the zero-region are where they were, to the bit; ${samples.one.length} of the ` +
    `one-region turned by ${motion.angleDeg.toFixed(3)}°, rigid to ${((1e6 * motion.rms) / diagonal).toFixed(2)} ppm of the ` +
    `diagonal (rms; ${((1e6 * motion.max) / diagonal).toFixed(1)} at most); ${samples.free.length} between them follow`
  );
}

async function tell(url) {
  const client = new ApiClient(url);
  const drc = readFileSync(dragon);
  const cloud = await step("upload the scan", async () => {
    const document = await uploadBytes(client, "Stanford dragon", drc);
    return [`${document.sample_count} samples, ${megabytes(drc.length)} of Draco`, document];
  });
  const session = await step("split shape and detail", async () => {
    const document = await openSession(client, cloud, { name: "Demo", scales: [0.02, 0.01, 0.005] });
    const share = (band) => `${((100 * band.max_detail) / document.diagonal).toFixed(2)} %`;
    return [
      `${document.decomposition.length} bands, details up to ${document.decomposition.map(share).join(", ")} of the diagonal`,
      document,
    ];
  });
  const picture = (name, mode) => takePicture(url, session.id, resolve(out, name), { camera, mode });
  await step("picture: before", () => picture("before.png", "shaded"));

  const { id } = session;
  await step("paint what stays", async () => {
    const { regions } = await client.putOperations(id, "zero", zeroOperations);
    return `${regions.zero.samples} samples`;
  });
  const revision = await step("paint what moves", async () => {
    let document;
    for (const operation of oneOperations) document = await client.addOperation(id, "one", operation);
    return [`${document.regions.one.samples} samples`, document.revision];
  });
  await step("picture: painted", () => picture("painted.png", "regions"));

  await step("drag the head", async () => {
    const frames = [];
    for (let sequence = 1; sequence <= previewCount; sequence++)
      frames.push(await preview(client, id, sequence, revision));
    await client.endPreview(id);
    const times = frames.map(({ ms }) => ms);
    return `${previewCount} frames, ${median(times).toFixed(1)} ms each (${Math.max(...times).toFixed(1)} at most), ${megabytes(frames[0].bytes)}`;
  });
  await step("commit the edit", async () => {
    const record = await client.commitEdit(id, turn(angleDeg), revision);
    return `${record.moved_samples} samples moved, now at revision ${(await client.session(id)).revision}`;
  });
  const edited = await step("download the result", async () => {
    const bytes = await download(client, `v1/sessions/${id}/samples?format=ply`);
    const file = resolve(out, "dragon-edited.ply");
    writeFileSync(file, bytes);
    return [`${here(file)}, ${megabytes(statSync(file).size)}`, bytes];
  });
  await step("check it", async () => {
    const original = await download(client, `v1/clouds/${cloud.id}/data?format=ply`);
    return verify(readPly(original), readPly(edited), cloud.diagonal);
  });
  await step("picture: after", () => picture("after.png", "shaded"));
  await step("picture: both", async () => {
    const file = resolve(out, "dragon.jpg");
    await putTogether([[resolve(out, "painted.png"), resolve(out, "after.png")]], 1280 / 800, file);
    return here(file);
  });
}

async function main() {
  rmSync(out, { recursive: true, force: true });
  mkdirSync(out, { recursive: true });
  console.log(
    "Turning the head of the Stanford dragon (Stanford 3D Scanning Repository, Stanford Computer Graphics Laboratory).",
  );
  const start = performance.now();
  const daemon = await step("start the daemon", async () => {
    const started = await startDaemon(["--web", resolve(root, "web/dist")]);
    return [started.url, started];
  });
  for (const signal of ["SIGINT", "SIGTERM"])
    process.once(signal, () => daemon.stop().then(() => process.exit(130)));
  let failure = null;
  try {
    await tell(daemon.url);
  } catch (error) {
    failure = error;
  }
  const status = await daemon.stop();
  if (failure) {
    console.error(`\ndemo: ${failure.message}`);
    console.error(`The daemon said:\n${daemon.log().split("\n").slice(-20).join("\n")}`);
  } else if (status !== 0) {
    console.error(`\ndemo: the daemon ended with ${status}\n${daemon.log()}`);
  } else {
    say("all", performance.now() - start, `pictures in ${here(out)}`);
  }
  process.exitCode = failure || status !== 0 ? 1 : 0;
}

main().catch((error) => {
  console.error(`demo: ${error.message}`);
  process.exitCode = 1;
});
