// The editor in a real browser against a real daemon: every test looks at the server's state, the picture, or both.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { waitForIdle } from "../../web/scripts/browser.mjs";
import {
  canvasPlace,
  checkTroubles,
  countPixels,
  drag,
  fill,
  frontCamera,
  json,
  open,
  openEditor,
  paintCaps,
  project,
  service,
  sessionUrl,
  startAroundTests,
  timeout,
  until,
  waitForRevision,
  waitMs,
} from "./support.mjs";

startAroundTests();

test("a link opens a session whose surface is whole and without holes", { timeout }, async () => {
  const { page, session, close } = await openEditor(40_000);
  const status = await page.evaluate(() => globalThis.pointwright.status);
  assert.equal(status.loadedSamples, session.sample_count);
  assert.equal(status.revision, 0);
  const pixels = await countPixels(page);
  assert.ok(pixels.right - pixels.left > 0.5, "the capsule lies across the picture");
  const box = await page.locator("canvas.viewport-canvas").boundingBox();
  const area = (pixels.right - pixels.left) * (pixels.bottom - pixels.top) * box.width * box.height;
  assert.ok(pixels.surface > 0.85 * area, `${pixels.surface} of ${area} pixels of its box are surface`);
  assert.equal(pixels.blue + pixels.red, 0);
  await close();
});

test("strokes of the mouse paint the regions on the server and in the picture", { timeout }, async () => {
  const { page, state, close } = await openEditor();
  await page.locator("canvas.viewport-canvas").focus();
  await page.keyboard.press("z");
  await drag(page, [await project(page, -0.9, 0.2), await project(page, -0.9, -0.2)]);
  await waitForRevision(page, 1);
  const zero = (await state()).regions.zero.samples;
  assert.ok(zero > 50, `${zero} samples`);
  await page.keyboard.press("o");
  await drag(page, [await project(page, 0.9, 0.2), await project(page, 0.9, -0.2)]);
  await waitForRevision(page, 2);
  const painted = await state();
  assert.ok(painted.regions.one.samples > 50);
  assert.equal(painted.regions.zero.samples, zero);
  const pixels = await countPixels(page);
  assert.ok(pixels.blue > 300, `${pixels.blue} blue pixels`);
  assert.ok(pixels.red > 300, `${pixels.red} red pixels`);
  assert.ok(pixels.redX > 0.5);

  await page.keyboard.press("e");
  await drag(page, [await project(page, 0.9, 0.25), await project(page, 0.9, -0.25)]);
  await page.waitForFunction((before) => globalThis.pointwright.status.revision > before, painted.revision);
  await waitForIdle(page, waitMs);
  const erased = await state();
  assert.ok(erased.regions.one.samples < painted.regions.one.samples / 2);
  assert.equal(erased.regions.zero.samples, zero);
  await close();
});

test("only what faces the viewer is painted", { timeout }, async () => {
  const { page, state, close } = await openEditor();
  await page.locator("canvas.viewport-canvas").focus();
  await page.keyboard.press("o");
  for (let i = 0; i < 30; i++) await page.keyboard.press("]");
  await page.mouse.click(...(await canvasPlace(page))(0.5, 0.5));
  await waitForRevision(page, 1);
  const { regions, sample_count } = await state();
  assert.ok(regions.one.samples > 0.2 * sample_count);
  assert.ok(regions.one.samples < 0.6 * sample_count, "the far side stays unpainted");
  await close();
});

test("the handle moves the one-region: preview, recorded edit, undo, redo", { timeout }, async () => {
  const { page, session, state, edits, close } = await openEditor();
  await paintCaps(session, page);
  const before = await countPixels(page);
  await page.locator("canvas.viewport-canvas").focus();
  await page.keyboard.press("g");
  await waitForIdle(page, waitMs);
  // The centre of the right cap lies near x = 0.97; the arrow along y begins there.
  const at = await canvasPlace(page);
  await page.mouse.move(...at(...(await project(page, 0.97, 0.28))));
  await page.waitForTimeout(300);
  await page.mouse.down();
  for (let i = 1; i <= 6; i++) await page.mouse.move(...at(...(await project(page, 0.97, 0.28 + 0.07 * i))));
  await page.waitForFunction(() => globalThis.pointwright.status.lastSequence > 0, null, { timeout: waitMs });
  await page.mouse.up();
  await waitForIdle(page, waitMs);
  assert.equal((await edits()).edits.length, 0, "a drag is not recorded");
  const during = await countPixels(page);
  assert.ok(during.redY < before.redY - 0.03, "the red cap has moved up");
  await page.keyboard.press("Enter");
  await page.waitForFunction(
    (revision) => globalThis.pointwright.status.revision > revision,
    session.revision + 2,
  );
  await waitForIdle(page, waitMs);
  const history = await edits();
  assert.equal(history.head, 1);
  const { deformation } = history.edits[0].edit;
  assert.equal(deformation.type, "translation");
  assert.ok(deformation.vector[1] > 0.2, `moved by ${deformation.vector}`);
  assert.ok(Math.abs(deformation.vector[0]) < 1e-6 && Math.abs(deformation.vector[2]) < 1e-6, "only along y");
  assert.ok(history.edits[0].moved_samples > 0);
  const recorded = await countPixels(page);
  assert.ok(Math.abs(recorded.redY - during.redY) < 0.01, "the recorded edit is what was previewed");

  await page.locator("canvas.viewport-canvas").focus();
  await page.keyboard.press("Control+z");
  await page.waitForFunction(
    (revision) => globalThis.pointwright.status.revision > revision,
    (await state()).revision - 1,
  );
  await page.waitForFunction(() => document.querySelector('[data-action="undo"]').disabled, null, {
    timeout: waitMs,
  });
  await waitForIdle(page, waitMs);
  assert.equal((await edits()).head, 0);
  assert.ok(Math.abs((await countPixels(page)).redY - before.redY) < 0.01, "undo brings the shape back");
  await page.keyboard.press("Control+Shift+Z");
  await page.waitForFunction(() => document.querySelector('[data-action="redo"]').disabled, null, {
    timeout: waitMs,
  });
  await waitForIdle(page, waitMs);
  assert.equal((await edits()).head, 1);
  assert.ok(Math.abs((await countPixels(page)).redY - recorded.redY) < 0.01);
  await close();
});

test("Escape drops a transform and leaves no trace", { timeout }, async () => {
  const { page, session, state, edits, close } = await openEditor();
  await paintCaps(session, page);
  const before = await countPixels(page);
  await page.keyboard.press("g");
  await page.getByLabel("Move by Y").fill("0.4");
  await page.waitForFunction(() => globalThis.pointwright.status.lastSequence > 0, null, { timeout: waitMs });
  await page.getByLabel("Move by Y").press("Escape");
  await page.waitForFunction(() => globalThis.pointwright.status.lastSequence === 0, null, {
    timeout: waitMs,
  });
  await waitForIdle(page, waitMs);
  assert.equal((await edits()).edits.length, 0);
  assert.equal((await state()).revision, 2);
  assert.ok(Math.abs((await countPixels(page)).redY - before.redY) < 0.01);
  await close();
});

test("the whole loop works by the keyboard: shapes and a rotation by numbers", { timeout }, async () => {
  const { page, state, edits, close } = await openEditor();
  const summary = page.locator("summary", { hasText: "Shape by numbers" });
  await summary.focus();
  await page.keyboard.press("Enter");
  const form = page.locator('[data-form="numbers"]');
  const paint = async (region, x) => {
    await form.getByLabel("Region").selectOption(region);
    await fill(form, { "Centre X": x, "Centre Y": 0, "Centre Z": 0, Radius: 0.6 });
    const { revision } = await state();
    await form.getByRole("button", { name: "Apply to region" }).press("Enter");
    await waitForRevision(page, revision + 1);
  };
  await paint("zero", -1.1);
  await paint("one", 1.1);
  const { regions, revision } = await state();
  assert.ok(regions.zero.samples > 0 && regions.one.samples > 0);
  await page.locator('[data-tool="rotate"]').press("Enter");
  await fill(page, { "Axis X": 0, "Axis Y": 0, "Axis Z": 1 });
  await fill(page, { "Pivot X": 0, "Pivot Y": 0, "Pivot Z": 0, Angle: 30 });
  await page.getByLabel("Angle", { exact: true }).press("Enter");
  await waitForRevision(page, revision + 1);
  const { edits: records } = await edits();
  assert.equal(records.length, 1);
  assert.equal(records[0].edit.deformation.type, "rotation");
  assert.equal(records[0].edit.deformation.angle_deg, 30);
  assert.deepEqual(records[0].edit.deformation.axis, { point: [0, 0, 0], direction: [0, 0, 1] });
  assert.ok((await countPixels(page)).redY < 0.45, "the right cap has turned up");
  await close();
});

test("a twist by numbers: preview, blend and detail, recorded edit", { timeout }, async () => {
  const { page, session, edits, close } = await openEditor();
  await paintCaps(session, page);
  const before = await countPixels(page);
  await page.locator("canvas.viewport-canvas").focus();
  await page.keyboard.press("t");
  const button = page.locator('[data-kind="twist"]');
  assert.equal(await button.getAttribute("aria-pressed"), "true");
  // From the middle of what stays to the middle of what moves, along the capsule.
  assert.ok(Number(await page.getByLabel("Axis X").inputValue()) > 0.999);
  const length = Number(await page.getByLabel("Over a length of").inputValue());
  assert.ok(length > 1.7 && length < 2.2, `over ${length}`);
  // About a line above the capsule, half a turn over the whole height lifts the right cap over it.
  await page.keyboard.press("x");
  await fill(page, { "Pivot X": -1, "Pivot Y": 0.4, "Pivot Z": 0, "Over a length of": 2, Angle: 180 });
  await page.getByLabel("Blend").selectOption("cosine");
  await page.waitForFunction(() => globalThis.pointwright.status.lastSequence > 0, null, { timeout: waitMs });
  await waitForIdle(page, waitMs);
  const during = await countPixels(page);
  assert.ok(during.redY < before.redY - 0.1, "the cap has turned up over the axis");
  assert.equal((await edits()).edits.length, 0, "a preview is not recorded");
  await page.locator("summary", { hasText: "Detail" }).click();
  await page.locator('[data-part="detail"] input[type=range]').last().fill("0.5");
  await waitForIdle(page, waitMs);
  const revision = await page.evaluate(() => globalThis.pointwright.status.revision);
  await page.getByRole("button", { name: "Apply", exact: true }).click();
  await waitForRevision(page, revision + 1);
  const [record] = (await edits()).edits;
  assert.deepEqual(record.edit.deformation, {
    type: "twist",
    axis: { point: [-1, 0.4, 0], direction: [1, 0, 0] },
    angle_deg: 180,
    length: 2,
  });
  assert.equal(record.edit.blend, "cosine");
  assert.deepEqual(record.edit.gains, [...session.levels.slice(2).map(() => 1), 0.5]);
  assert.match(await page.locator(".history-entry").nth(1).textContent(), /Twisted 180°/);
  assert.ok(Math.abs((await countPixels(page)).redY - during.redY) < 0.02, "what was previewed");
  await close();
});

test("the export is the edited cloud", { timeout }, async () => {
  const { page, session, close } = await openEditor();
  await page.getByText("Export", { exact: true }).click();
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.locator('[data-format="ply"]').click(),
  ]);
  assert.equal(download.suggestedFilename(), "Capsule.ply");
  const bytes = readFileSync(await download.path());
  assert.match(bytes.toString("latin1", 0, 400), new RegExp(`element vertex ${session.sample_count}\\n`));
  await close();
});

test("a link carries the camera and the display", { timeout }, async () => {
  const { page, session, close } = await openEditor();
  await page.getByLabel("Show").selectOption("t");
  await waitForIdle(page, waitMs);
  await page.waitForFunction(() => /mode=t/.test(location.hash) && /cam=0,0,6;/.test(location.hash), null, {
    timeout: waitMs,
  });
  assert.ok(await page.locator(".colour-bar").isVisible());
  const hash = await page.evaluate(() => location.hash);
  await close();
  const second = await open(sessionUrl(service, session, hash));
  await waitForIdle(second.page, waitMs);
  const camera = await second.page.evaluate(() => globalThis.pointwright.camera);
  for (const [axis, value] of camera.position.entries()) {
    assert.ok(Math.abs(value - frontCamera.position[axis]) < 1e-4);
  }
  assert.equal(await second.page.getByLabel("Show").inputValue(), "t");
  await checkTroubles(second.page, second.troubles);
  await second.page.close();
});

test("the base level shows another surface, follows what others paint and edit, and is left again", {
  timeout,
}, async () => {
  const { page, session, edits, close } = await openEditor();
  const picture = () => page.locator("canvas.viewport-canvas").screenshot({ timeout: waitMs });
  const full = await picture();
  await page.getByLabel("Level").selectOption("0");
  await waitForIdle(page, waitMs);
  assert.ok((await countPixels(page)).surface > 3000);
  assert.ok(!full.equals(await picture()), "the base is smoother than the full surface");
  await paintCaps(session, page);
  await until(async () => (await countPixels(page)).blue > 500, "the others' painting shows on the base");

  const edit = { level: 0, deformation: { type: "translation", vector: [0, 1, 0] } };
  const { revision } = await json(`${service.url}/v1/sessions/${session.id}`);
  const answer = await fetch(`${service.url}/v1/sessions/${session.id}/edits`, {
    method: "POST",
    headers: { "Content-Type": "application/json", "If-Match": `"r${revision}"` },
    body: JSON.stringify(edit),
  });
  assert.equal(answer.status, 201);
  await waitForRevision(page, revision + 1);
  await page.locator(".history-entry").nth(1).waitFor({ timeout: waitMs });
  await page.getByRole("button", { name: "Undo" }).click();
  await waitForRevision(page, revision + 2);
  assert.equal((await edits()).head, 0);

  await page.getByLabel("Level").selectOption("full");
  await waitForIdle(page, waitMs);
  assert.ok((await countPixels(page)).surface > 3000);
  await close();
});

test("the picture comes back after the graphics context was lost", { timeout }, async () => {
  const { page, close } = await openEditor();
  const before = await countPixels(page);
  await page.evaluate(async () => {
    const context = document
      .querySelector("canvas.viewport-canvas")
      .getContext("webgl2")
      .getExtension("WEBGL_lose_context");
    context.loseContext();
    await new Promise((done) => setTimeout(done, 600));
    context.restoreContext();
  });
  await page.waitForTimeout(600);
  await waitForIdle(page, waitMs);
  // The notice lies over the picture while it shows.
  await page.locator(".toast").waitFor({ state: "detached", timeout: waitMs });
  const after = await countPixels(page);
  assert.ok(
    Math.abs(after.surface - before.surface) < 0.05 * before.surface,
    `${after.surface} of ${before.surface} pixels`,
  );
  await close();
});
