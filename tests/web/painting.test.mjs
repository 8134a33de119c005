// Painting beyond the brush, and the transforms beyond one step, by hand: the pointer, the keys and the fields.
import assert from "node:assert/strict";
import { test } from "node:test";
import { waitForIdle } from "../../web/scripts/browser.mjs";
import {
  canvasPlace,
  countPixels,
  drag,
  fill,
  json,
  openEditor,
  paintCaps,
  project,
  service,
  startAroundTests,
  timeout,
  until,
  waitForRevision,
  waitMs,
} from "./support.mjs";

startAroundTests();

/** Small: the pictures are drawn in software, and these tests are about what the server is told. */
const samples = 3000;
const openSmall = () => openEditor(samples, { width: 780, height: 440 });
const canvas = (page) => page.locator("canvas.viewport-canvas");

/** Draws a curve through places of the front plane, with a key held. */
async function draw(page, places, key) {
  const fractions = [];
  for (const [x, y] of places) fractions.push(await project(page, x, y));
  if (key) await page.keyboard.down(key);
  await drag(page, fractions);
  if (key) await page.keyboard.up(key);
}

/** Presses keys over the view and waits until the session has one more revision. */
async function change(page, state, act) {
  const { revision } = await state();
  await act();
  await waitForRevision(page, revision + 1);
  return (await state()).regions;
}

test("outlines choose on all depths, take away and keep, and are dropped by Escape", {
  timeout,
}, async () => {
  const { page, state, close } = await openSmall();
  await canvas(page).focus();
  await page.keyboard.press("z");
  await page.keyboard.press("u");
  const box = [
    [-1.4, 0.6],
    [-0.6, -0.6],
  ];
  const { zero } = await change(page, state, () => draw(page, box));
  // The capsule's surface left of x = -0.6 is a quarter of it, the far side included.
  assert.ok(Math.abs(zero.samples - samples / 4) < 40, `${zero.samples} samples left of the edge`);

  const lasso = [
    [-1.4, 0.6],
    [-1.4, -0.1],
    [-0.5, -0.1],
    [-0.5, 0.6],
  ];
  await page.keyboard.press("l");
  const upper = await change(page, state, () => draw(page, lasso, "Alt"));
  assert.ok(upper.zero.samples > 0.4 * zero.samples && upper.zero.samples < 0.75 * zero.samples);
  const lower = await change(page, state, () => draw(page, lasso.slice(0, 4), "Shift"));
  assert.ok(lower.zero.samples < 0.1 * zero.samples, `${lower.zero.samples} remain`);

  // A polygon by clicks: Escape drops it, Enter closes it.
  await page.keyboard.press("o");
  await page.keyboard.press("p");
  const corners = [
    [0.6, 0.6],
    [1.4, 0.6],
    [1.4, -0.6],
    [0.6, -0.6],
  ];
  const click = async ([x, y]) =>
    page.mouse.click(...(await canvasPlace(page))(...(await project(page, x, y))));
  for (const corner of corners.slice(0, 3)) await click(corner);
  assert.ok(await page.locator(".outline-layer").isVisible());
  const before = await state();
  await page.keyboard.press("Escape");
  assert.ok(!(await page.locator(".outline-layer").isVisible()));
  for (const corner of corners) await click(corner);
  const { one } = await change(page, state, () => page.keyboard.press("Enter"));
  assert.equal((await state()).revision, before.revision + 1, "the dropped polygon painted nothing");
  assert.ok(Math.abs(one.samples - samples / 4) < 40, `${one.samples} samples right of the edge`);
  const pixels = await countPixels(page);
  assert.ok(pixels.red > 1000 && pixels.redX > 0.6);
  assert.equal(await page.locator('[data-method="polygon"].tool').getAttribute("aria-pressed"), "true");
  await close();
});

test("a flood fills what the other region leaves, and regions grow, shrink, invert and clear", {
  timeout,
}, async () => {
  const { page, state, close } = await openSmall();
  await canvas(page).focus();
  const undo = () => page.keyboard.press("Control+z");
  // A line around the middle keeps the flood of the left half from the right one.
  await page.keyboard.press("z");
  await page.keyboard.press("d");
  const line = [
    [0, 0.6],
    [0, -0.6],
  ];
  const { zero } = await change(page, state, () => draw(page, line));
  assert.ok(zero.samples > 100, `${zero.samples} in the line`);
  await page.keyboard.press("o");
  await page.keyboard.press("w");
  await page.getByLabel("Stop at edges").uncheck();
  const left = await project(page, -0.7, 0.05);
  const flooded = await change(page, state, async () =>
    page.mouse.click(...(await canvasPlace(page))(...left)),
  );
  assert.ok(
    Math.abs(flooded.one.samples - (samples - zero.samples) / 2) < 60,
    `${flooded.one.samples} flooded`,
  );
  assert.equal(flooded.zero.samples, zero.samples);

  await canvas(page).focus();
  const grown = await change(page, state, () => page.keyboard.press("."));
  assert.ok(grown.one.samples > flooded.one.samples && grown.zero.samples < zero.samples);
  // Growing took samples from the other region: both come back, in as many changes as that takes.
  await undo();
  await until(async () => {
    const { regions } = await state();
    return regions.one.samples === flooded.one.samples && regions.zero.samples === zero.samples;
  }, "growing is undone");
  await waitForIdle(page, waitMs);
  await page.locator('[data-region="one"] [aria-controls]').click();
  const shrunk = await change(page, state, () =>
    page.locator('[data-region="one"] [data-command="shrink"]').click(),
  );
  assert.ok(shrunk.one.samples < flooded.one.samples);
  await canvas(page).focus();
  const back = await change(page, state, undo);
  assert.deepEqual(back.one, flooded.one);
  const inverted = await change(page, state, () => page.keyboard.press("Control+i"));
  assert.equal(inverted.one.samples, samples - flooded.one.samples);
  assert.equal(inverted.zero.samples, 0);
  await undo();
  await until(async () => (await state()).regions.zero.samples === zero.samples, "inverting is undone");
  await waitForIdle(page, waitMs);
  const cleared = await change(page, state, () => page.keyboard.press("Delete"));
  assert.equal(cleared.one.samples, 0);
  const again = await change(page, state, undo);
  assert.deepEqual(again.one, flooded.one);
  const redone = await change(page, state, () => page.keyboard.press("Control+y"));
  assert.equal(redone.one.samples, 0);
  await close();
});

test("scale by its handle and along the normals by its slider", { timeout }, async () => {
  const { page, session, edits, close } = await openSmall();
  await paintCaps(session, page);
  await canvas(page).focus();
  await page.keyboard.press("s");
  // The middle handle stands in the middle of the right cap: looked at straight on, no other one lies before it.
  const pivot = Number(await page.getByLabel("Pivot X").inputValue());
  await page.evaluate((x) => {
    globalThis.pointwright.camera = { position: [x, 0, 6], target: [x, 0, 0], up: [0, 1, 0] };
  }, pivot);
  await waitForIdle(page, waitMs);
  const before = await countPixels(page);
  const [x, y] = (await canvasPlace(page))(0.5, 0.5);
  await page.mouse.move(x, y);
  await page.waitForTimeout(300);
  await page.mouse.down();
  await page.mouse.move(x + 30, y - 30, { steps: 4 });
  await page.waitForFunction(() => globalThis.pointwright.status.lastSequence > 0, null, { timeout: waitMs });
  await page.mouse.up();
  await waitForIdle(page, waitMs);
  const during = await countPixels(page);
  assert.ok(during.red > 1.2 * before.red, `from ${before.red} to ${during.red} red pixels`);
  const { revision } = await page.evaluate(() => globalThis.pointwright.status);
  await page.keyboard.press("Enter");
  await waitForRevision(page, revision + 1);
  const [scale] = (await edits()).edits;
  assert.equal(scale.edit.deformation.type, "scale");
  const [factor] = scale.edit.deformation.factors;
  assert.deepEqual(scale.edit.deformation.factors, [factor, factor, factor]);
  assert.ok(factor > 1.2 && factor < 2, `by ${factor}`);

  await page.keyboard.press("n");
  const slider = page.getByLabel("Carve – raise");
  await slider.fill("-0.5");
  const distance = Number(await page.getByLabel("Distance").inputValue());
  assert.ok(distance < 0, `${distance} is inwards`);
  await page.getByLabel("Distance").press("Enter");
  await waitForRevision(page, revision + 2);
  const carved = (await edits()).edits[1].edit.deformation;
  assert.equal(carved.type, "along_normal");
  assert.ok(Math.abs(carved.distance - distance) < 1e-9);
  await close();
});

test("toward a point that is clicked, and a composition of steps", { timeout }, async () => {
  const { page, session, edits, close } = await openSmall();
  await paintCaps(session, page);
  await canvas(page).focus();
  await page.keyboard.press("a");
  const at = await canvasPlace(page);
  await page.mouse.click(...at(...(await project(page, 0.2, 0.1))));
  const target = [];
  for (const axis of "XYZ") target.push(Number(await page.getByLabel(`Target ${axis}`).inputValue()));
  assert.ok(Math.abs(target[0] - 0.2) < 0.05 && Math.abs(target[1] - 0.1) < 0.05, `clicked ${target}`);
  assert.ok(target[2] > 0.3, "on the front side");
  await fill(page, { Amount: 40 });
  await page.getByRole("button", { name: "Add step" }).click();
  await page.locator('[data-kind="rotate"]').click();
  await fill(page, {
    "Pivot X": 0,
    "Pivot Y": 0,
    "Pivot Z": 0,
    "Axis X": 0,
    "Axis Y": 0,
    "Axis Z": 1,
    Angle: 20,
  });
  await page.getByRole("button", { name: "Add step" }).click();
  await page.locator('[data-kind="move"]').click();
  await fill(page, { "Move by Y": 0.1 });
  assert.equal(await page.locator(".step").count(), 3);
  await page.getByRole("button", { name: "Step 3: earlier" }).click();
  await page.getByRole("button", { name: "Step 1: remove" }).click();
  assert.match(await page.locator(".step").first().textContent(), /Moved/);
  assert.equal((await edits()).edits.length, 0, "steps are not recorded by themselves");
  await page.locator(".badge.exact").waitFor({ timeout: waitMs });
  const during = await countPixels(page);
  const { revision } = await page.evaluate(() => globalThis.pointwright.status);
  await page.getByRole("button", { name: "Apply", exact: true }).click();
  await waitForRevision(page, revision + 1);
  const [{ edit }] = (await edits()).edits;
  assert.deepEqual(edit.deformation, {
    type: "sequence",
    steps: [
      { type: "translation", vector: [0, 0.1, 0] },
      { type: "rotation", axis: { point: [0, 0, 0], direction: [0, 0, 1] }, angle_deg: 20 },
    ],
  });
  assert.ok(Math.abs((await countPixels(page)).redY - during.redY) < 0.02, "what was previewed");
  await page.keyboard.press("a");
  await fill(page, { "Target X": 0, "Target Y": 0, "Target Z": 0, Amount: 25 });
  await page.getByLabel("Amount").press("Enter");
  await waitForRevision(page, revision + 2);
  assert.deepEqual((await edits()).edits[1].edit.deformation, {
    type: "toward_point",
    target: [0, 0, 0],
    amount: 0.25,
  });
  await close();
});

test("a region is saved under a name, cleared, and joins again from the list", { timeout }, async () => {
  const { page, state, close } = await openSmall();
  const session = (await state()).id;
  const put = (region, operations) =>
    json(`${service.url}/v1/sessions/${session}/regions/${region}`, {
      method: "PUT",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ operations }),
    });
  await put("one", [{ mode: "add", shape: { type: "half_space", point: [0.5, 0, 0], normal: [1, 0, 0] } }]);
  await waitForRevision(page, (await state()).revision);
  const { samples: count } = (await state()).regions.one;
  assert.ok(count > 100);

  await page.locator("summary", { hasText: "Saved regions" }).click();
  const form = page.locator('form[data-form="save-region"]');
  await form.getByLabel("Save as").fill("t");
  await form.getByRole("button", { name: "Save region" }).click();
  await page.getByText("means something else here").waitFor();
  await form.getByLabel("Save as").fill("right end");
  const saved = await change(page, state, () => form.getByRole("button", { name: "Save region" }).click());
  assert.deepEqual(saved.named, [{ region: "right end", samples: count, operations: 1 }]);
  const row = page.locator('[data-saved="right end"]');
  assert.match(await row.textContent(), new RegExp(count.toLocaleString("en")));

  await change(page, state, () => page.getByLabel("Clear the one-region").click());
  const { zero } = await change(page, state, () =>
    row.getByRole("button", { name: "Add right end to the zero-region" }).click(),
  );
  assert.equal(zero.samples, count);
  // What was painted with it can be undone; the saved one stays until it is deleted.
  await canvas(page).focus();
  const undone = await change(page, state, () => page.keyboard.press("Control+z"));
  assert.equal(undone.zero.samples, 0);
  assert.equal(undone.named.length, 1);
  await change(page, state, () => page.getByLabel("Delete the saved region right end").click());
  await page.getByText("None yet.").waitFor();
  await close();
});
