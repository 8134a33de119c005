// Figures of the paper, made through the public HTTP API and the real viewer: the elementary deformations of Figure 5, the
// pulled plane of Figure 7, and the embossed plate of Figure 10 that is lifted on one resolution and on several. `make figures` builds what it needs and runs it.
import { mkdirSync, rmSync } from "node:fs";
import { resolve } from "node:path";
import { launchBrowser } from "../scripts/browser.mjs";
import { ApiClient, download, here, openSession, root, step, takePicture, uploadBytes } from "./api.mjs";
import { averaged } from "./averaged.mjs";
import { putTogether } from "./beside.mjs";
import { startDaemon } from "./daemon.mjs";
import { checkerboard, plate } from "./plate.mjs";

const out = resolve(root, "build/figures");
const side = 352;
const size = "1000x800";
const aspect = 1000 / 800;

const put = (client, { id }, region, operations) => client.putOperations(id, region, operations);
async function commit(client, { id }, edit) {
  return client.commitEdit(id, edit, (await client.session(id)).revision);
}
async function goTo(client, { id }, edit) {
  return client.putHead(id, edit, (await client.session(id)).revision);
}

const add = (shape) => ({ mode: "add", shape });
const beyondCircle = [add({ type: "sphere", center: [0, 0, 0], radius: 0.85 }), { mode: "invert" }];
const beyondSquare = [
  add({ type: "box", min: [-0.85, -0.85, -1], max: [0.85, 0.85, 1] }),
  { mode: "invert" },
];

/** Two edits: what stays, what moves, and how. */
const examples = [
  {
    name: "disc",
    zero: beyondCircle,
    one: [add({ type: "sphere", center: [0, 0, 0], radius: 0.3 })],
    deformation: { type: "translation", vector: [0, 0, 0.7] },
  },
  {
    name: "bar",
    zero: beyondSquare,
    one: [
      add({
        type: "stroke",
        vertices: [
          [-0.4, 0, 0],
          [0.4, 0, 0],
        ],
        radius: 0.12,
      }),
    ],
    deformation: { type: "rotation", axis: { point: [0, 0, 0], direction: [0, -1, 0] }, angle_deg: 60 },
  },
];

async function elementaryDeformations(url) {
  const client = new ApiClient(url);
  const camera = { position: [0.5, -2.5, 1.9], target: [0, -0.05, 0.1], up: [0, 0, 1] };
  const cloud = await uploadBytes(client, "Plate", plate(side, { colour: checkerboard(16) }));
  const session = await openSession(client, cloud, { name: "Figure 5", scales: [0.01] });
  const rows = [];
  for (const { name, zero, one, deformation } of examples) {
    await put(client, session, "zero", zero);
    await put(client, session, "one", one);
    const file = (mode) => resolve(out, `${name}-${mode}.png`);
    const picture = (mode) => takePicture(url, session.id, file(mode), { camera, mode, size });
    await picture("regions");
    await picture("t");
    await commit(client, session, { level: 0, deformation });
    for (const region of ["zero", "one"]) await put(client, session, region, []); // their tint would hide the colours
    await picture("color");
    await goTo(client, session, 0);
    rows.push(["regions", "t", "color"].map(file));
  }
  const figure = resolve(out, "figure-5.jpg");
  await putTogether(rows, aspect, figure);
  return here(figure);
}

/** Pulls the middle of a checkered plane up: holes without resampling; with it, crisp, and blurred as the paper's caption says. */
async function pulledPlane(url) {
  const client = new ApiClient(url);
  const samples = 100 * 100;
  const cloud = await uploadBytes(client, "Plane", plate(100, { colour: checkerboard(16) }));
  const session = await openSession(client, cloud, { name: "Figure 7", scales: [0.02] });
  const circle = (radius) => add({ type: "sphere", center: [0, 0, 0], radius });
  await put(client, session, "zero", [circle(0.9), { mode: "invert" }]);
  await put(client, session, "one", [circle(0.1)]);
  const camera = { position: [1.1, -4.5, 2.7], target: [0, 0, 0.82], up: [0, 0, 1] };
  const file = (name) => resolve(out, `${name}.png`);
  const picture = (id, name) => takePicture(url, id, file(name), { camera, mode: "color", size });
  const clear = async () => {
    for (const region of ["zero", "one"]) await put(client, session, region, []); // their tint would hide the colours
  };
  const pull = { level: 0, deformation: { type: "translation", vector: [0, 0, 1.9] } };
  await commit(client, session, pull);
  await clear();
  await picture(session.id, "stretched");
  await goTo(client, session, 0);
  await put(client, session, "zero", [circle(0.9), { mode: "invert" }]);
  await put(client, session, "one", [circle(0.1)]);
  await commit(client, session, { ...pull, resampling: {} });
  await clear();
  await picture(session.id, "resampled");
  const exported = await download(client, `v1/sessions/${session.id}/samples?format=ply`);
  const blurred = averaged(exported, samples, 10);
  const other = await uploadBytes(client, "Averaged", blurred);
  const shown = await openSession(client, other, { name: "Figure 7, averaged", scales: [0.02] });
  await picture(shown.id, "averaged");
  const figure = resolve(out, "figure-7.jpg");
  await putTogether([["stretched", "resampled", "averaged"].map(file)], aspect, figure);
  return here(figure);
}

/** The name as white letters on black, as a PNG. */
async function lettering() {
  const browser = await launchBrowser();
  try {
    const page = await browser.newPage({ viewport: { width: 1024, height: 1024 } });
    await page.setContent(
      '<body style="margin:0;background:#000;color:#fff;display:grid;place-items:center;height:100vh;text-align:center;' +
        'font:bold 250px/1.1 sans-serif"><div style="filter:blur(7px)">Point<br>wright</div></body>',
    );
    return await page.screenshot({ type: "png" });
  } finally {
    await browser.close();
  }
}

/** Bright pixels move up, dark ones stay: the letters are embossed by a translation. Then the plate is lifted at one side. */
async function embossedPlate(url) {
  const client = new ApiClient(url);
  const cloud = await uploadBytes(client, "Embossed plate", plate(side));
  const session = await openSession(client, cloud, { name: "Figure 10", scales: [0.06] });
  const image = await client.uploadImage(await lettering());
  const letters = (threshold, side) => ({
    mode: "add",
    shape: {
      type: "image",
      image: image.id,
      threshold,
      side,
      projection: { type: "texture", repeat: false },
    },
  });
  await put(client, session, "zero", [letters(0.12, "below")]);
  await put(client, session, "one", [letters(0.88, "above")]);
  const above = { position: [0.2, -1.9, 2.5], target: [0, 0, 0], up: [0, 0, 1] };
  const file = (name) => resolve(out, `${name}.png`);
  await takePicture(url, session.id, file("letters"), { camera: above, mode: "regions", size });
  const finest = session.levels.length - 1;
  await commit(client, session, {
    level: finest,
    deformation: { type: "translation", vector: [0, 0, 0.09] },
  });
  await takePicture(url, session.id, file("embossed"), { camera: above, mode: "shaded", size });

  const half = (sign, x) => ({
    mode: "add",
    shape: { type: "half_space", point: [sign * x, 0, 0], normal: [sign, 0, 0] },
  });
  await put(client, session, "zero", [half(-1, 0.85)]);
  await put(client, session, "one", [half(1, 0.85)]);
  // Straight up, off the slope's normal: where one resolution moves the letters with it, they lean.
  const lift = { type: "translation", vector: [0, 0, 1.3] };
  const beside = { position: [0.15, -2.6, 1.55], target: [0.05, -0.1, 0.6], up: [0, 0, 1] };
  for (const [name, level] of [
    ["single-resolution", finest],
    ["multiresolution", 0],
  ]) {
    await commit(client, session, { level, deformation: lift });
    await takePicture(url, session.id, file(name), { camera: beside, mode: "shaded", size });
    await goTo(client, session, 1);
  }
  const figure = resolve(out, "figure-10.jpg");
  const rows = [
    ["letters", "embossed"],
    ["single-resolution", "multiresolution"],
  ];
  await putTogether(
    rows.map((row) => row.map(file)),
    aspect,
    figure,
  );
  return here(figure);
}

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
const daemon = await startDaemon(["--web", resolve(root, "web/dist")]);
for (const signal of ["SIGINT", "SIGTERM"])
  process.once(signal, () => daemon.stop().then(() => process.exit(130)));
try {
  const wanted = process.argv.slice(2); // numbers of figures; none: all
  const figures = { 5: elementaryDeformations, 7: pulledPlane, 10: embossedPlate };
  for (const [number, make] of Object.entries(figures))
    if (wanted.length === 0 || wanted.includes(number))
      await step(`Figure ${number}`, () => make(daemon.url));
} catch (error) {
  console.error(`figures: ${error.message}\n${daemon.log().split("\n").slice(-10).join("\n")}`);
  process.exitCode = 1;
}
const status = await daemon.stop();
if (status !== 0) process.exitCode = 1;
