// Regions from an image, a model and the view alone, and the recorded edits as a recipe and as an animation, by hand.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { waitForIdle } from "../../web/scripts/browser.mjs";
import {
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
  waitMs,
} from "./support.mjs";

startAroundTests();

const samples = 3000;

/** A PNG with a dark left half and a bright right one. */
async function halves(page) {
  const text = await page.evaluate(async () => {
    const canvas = new OffscreenCanvas(64, 32);
    const context = canvas.getContext("2d");
    context.fillStyle = "#000";
    context.fillRect(0, 0, 32, 32);
    context.fillStyle = "#fff";
    context.fillRect(32, 0, 32, 32);
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer());
    return btoa(String.fromCharCode(...bytes));
  });
  return Buffer.from(text, "base64");
}

/** A small page, and what both tests do on it. Pictures are waited for only where they are looked at. */
async function openSmall() {
  const editor = await openEditor(samples, { width: 780, height: 440 });
  const { page, state } = editor;
  const canvas = page.locator("canvas.viewport-canvas");
  const press = async (...keys) => {
    await canvas.focus();
    for (const key of keys) await page.keyboard.press(key);
  };
  const section = (name) => page.locator("summary", { hasText: name });
  /** Acts, and waits until the viewer knows of as many new revisions. */
  const change = async (revisions, act) => {
    const { revision } = await state();
    await act();
    await page.waitForFunction(
      (wanted) => globalThis.pointwright.status.revision >= wanted,
      revision + revisions,
    );
    return (await state()).regions;
  };
  /** The samples of the two regions, and the number of edits. */
  const counts = async () => {
    const { regions, history } = await state();
    return [regions.zero.samples, regions.one.samples, history.head];
  };
  /** Undoes or redoes one step, in as many requests as that takes: the last may come after the numbers are right. */
  const step = async (key, expected) => {
    await press(key);
    await until(
      async () => String(await counts()) === String(expected),
      `${key} does not lead to ${expected}`,
    );
  };
  return { ...editor, press, section, change, counts, step };
}

test("regions from an image, from a model, and from what is visible alone", { timeout }, async () => {
  const { page, session, press, section, change, counts, step, close } = await openSmall();

  // An image laid over the view, straight on: dark stays, bright moves.
  await section("Regions from an image").click();
  const choose = page.getByLabel("PNG image");
  await choose.setInputFiles({ name: "notes.png", mimeType: "image/png", buffer: Buffer.from("no picture") });
  await page.getByText("notes.png is no PNG image").waitFor();
  const placer = page.locator(".image-placer");
  assert.equal(await placer.count(), 0, "what is no image is not laid over the view");
  await choose.setInputFiles({ name: "halves.png", mimeType: "image/png", buffer: await halves(page) });
  await placer.waitFor();
  const layOver = page.getByRole("button", { name: "Lay the image over the view" });
  await page.keyboard.press("Escape");
  assert.equal(await placer.count(), 0, "Escape takes the image away");
  await layOver.click();
  await placer.waitFor();
  await press("z");
  assert.equal(await placer.count(), 0, "a tool takes the image away");
  await layOver.click();
  const images = await change(2, () => page.getByRole("button", { name: "Apply image" }).click());
  // What was applied is taken away.
  await placer.waitFor({ state: "detached" });
  // The half of the surface that faces the view, cut in the middle.
  for (const { samples: held } of [images.zero, images.one])
    assert.ok(Math.abs(held - samples / 4) < 60, `${held} samples of half the front`);
  await waitForIdle(page, waitMs);
  const { blue, red, redX } = await countPixels(page);
  assert.ok(
    redX > 0.55 && Math.abs(blue - red) < 0.1 * red,
    `${blue} blue pixels and ${red} red ones about ${redX}`,
  );

  // A model: the same cloud, moved along itself. The cylinders meet from x = 0.4 to 0.8, and beyond that the surfaces part
  // by less than the thickness for another 0.24 and 0.26. The near half of what lies there is red already.
  await section("Regions from another model").click();
  const models = page.locator("form", { hasText: "Apply model" });
  const model = models.getByLabel("Model");
  await until(async () => (await model.inputValue()) === session.cloud, "the cloud is not listed");
  await fill(models, { Thickness: 0.08, "Moved by X": 1.2 });
  const before = await counts();
  const near = await change(1, () => models.getByRole("button", { name: "Apply model" }).click());
  const added = near.one.samples - before[1];
  assert.ok(Math.abs(added - (samples / 2) * (0.9 / 2.4)) < 60, `${added} samples by the model`);
  assert.equal(near.zero.samples, before[0], "the blue half lies elsewhere");
  await step("Control+z", before);
  await waitForIdle(page, waitMs);

  // A rectangle that chooses what is visible alone: of the quarter left of its edge the front half.
  await press("o", "u", "v");
  const corners = [await project(page, -1.4, 0.6), await project(page, -0.6, -0.6)];
  const visible = await change(1, () => drag(page, corners));
  const joined = visible.one.samples - before[1];
  assert.ok(Math.abs(joined - samples / 8) < 90, `${joined} samples are visible in the rectangle`);
  await close();
});

test("a recipe brings edit and regions back as one step, and the animation shows part of the way", {
  timeout,
}, async () => {
  const { page, session, edits, press, section, change, counts, step, close } = await openSmall();
  await paintCaps(session, page);
  const painted = await counts();
  assert.equal(painted[2], 0);
  const { redY: from } = await countPixels(page);

  // An edit, its recipe, and the recipe applied to the surface before that edit, whose painting has changed.
  await press("g");
  await fill(page, { "Move by Y": 0.4 });
  await section("Playback and recipe").click();
  await change(1, () => page.getByLabel("Move by Y").press("Enter"));
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.locator('[data-action="recipe"]').click(),
  ]);
  assert.equal(download.suggestedFilename(), "Capsule.recipe.json");
  const file = readFileSync(await download.path());
  const recorded = (await edits()).edits.map(({ edit }) => edit);
  assert.deepEqual(
    recorded.map(({ deformation }) => deformation),
    [{ type: "translation", vector: [0, 0.4, 0] }],
  );
  await step("Control+z", painted);
  await waitForIdle(page, waitMs);
  const cleared = await change(1, () => press("o", "Delete"));
  assert.equal(cleared.one.samples, 0);
  const changed = await counts();
  const recipes = page.getByLabel("Recipe file");
  await recipes.setInputFiles({
    name: "torn.json",
    mimeType: "application/json",
    buffer: file.subarray(0, 40),
  });
  await page.getByText("torn.json is no recipe").waitFor();
  await change(1, () =>
    recipes.setInputFiles({ name: "one.json", mimeType: "application/json", buffer: file }),
  );
  const applied = [painted[0], painted[1], 1];
  assert.deepEqual(await counts(), applied);
  assert.deepEqual(
    (await edits()).edits.map(({ edit }) => edit),
    recorded,
    "the recipe's edit is the one it was made from",
  );
  await page.getByText("The regions are those of the recipe now").waitFor();
  await step("Control+z", changed);
  await step("Control+z", painted);
  await step("Control+y", changed);
  await step("Control+y", applied);
  assert.equal(await page.getByText("Someone else painted").count(), 0, "all changes were this page's own");

  // The animation: half of the way, with no tool at hand. The red brush's own controls are no part of the picture.
  await press("Escape");
  await waitForIdle(page, waitMs);
  const { redY: to } = await countPixels(page);
  assert.ok(from - to > 0.08, `the red cap rose from ${from} to ${to}`);
  const slider = page.getByLabel("Part of the way");
  await press("z");
  await slider.fill("0.5");
  assert.equal(await page.locator('[data-tool="orbit"]').getAttribute("aria-pressed"), "true");
  await until(async () => {
    await waitForIdle(page, waitMs);
    const { redY } = await countPixels(page);
    return Math.abs(redY - (from + to) / 2) < 0.15 * (from - to);
  }, "the red cap is not shown halfway");
  // A change of the session leaves it, and an edit that is pending keeps it away.
  await change(1, () =>
    json(`${service.url}/v1/sessions/${session.id}/regions/zero/operations`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ mode: "add", shape: { type: "sphere", center: [-0.5, 0, 0], radius: 0.5 } }),
    }),
  );
  assert.equal(await slider.inputValue(), "1", "the painting left the animation");
  await waitForIdle(page, waitMs);
  const { redY: back } = await countPixels(page);
  assert.ok(Math.abs(back - to) < 0.01, `the red cap is at ${back}, not at ${to}`);
  await press("g");
  await fill(page, { "Move by Y": 0.2 });
  assert.ok(await slider.isDisabled());
  await press("Escape");
  assert.ok(await slider.isEnabled());
  await close();
});
