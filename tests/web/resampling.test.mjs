// Dynamic resampling in the viewer: the count grows in the preview, with the recorded edit, and follows undo and redo.
import assert from "node:assert/strict";
import { test } from "node:test";
import { waitForIdle } from "../../web/scripts/browser.mjs";
import { openEditor, paintCaps, pixelsOf, startAroundTests, timeout, waitMs } from "./support.mjs";

startAroundTests();

const SAMPLES = 8000;
const camera = { position: [0.6, 0, 9], target: [0.6, 0, 0], up: [0, 1, 0] };

/** Pixels of the background that show through the middle of the pulled capsule, which the view shows along its length. */
async function holes(page) {
  const box = await page.locator("canvas.viewport-canvas").boundingBox();
  const perUnit = box.height / 2 / (camera.position[2] * Math.tan((16 * Math.PI) / 180));
  const at = (x, y) => [
    box.x + box.width / 2 + (x - camera.position[0]) * perUnit,
    box.y + box.height / 2 - y * perUnit,
  ];
  const [left, top] = at(-0.5, 0.25);
  const [right, bottom] = at(0.6, -0.25);
  const clip = { x: left, y: top, width: right - left, height: bottom - top };
  const shot = await page.screenshot({ clip, timeout: waitMs });
  return (await pixelsOf(page, shot)).evaluate(({ data: pixels }) => {
    let dark = 0;
    for (let i = 0; i < pixels.length; i += 4)
      if (Math.max(pixels[i], pixels[i + 1], pixels[i + 2]) < 60) dark++;
    return dark;
  });
}

test("a pull with resampling: more samples in the preview and after it, undone and redone", {
  timeout,
}, async () => {
  const { page, session, state, edits, close } = await openEditor(SAMPLES);
  await paintCaps(session, page);
  await page.evaluate((wanted) => {
    globalThis.pointwright.camera = wanted;
  }, camera);
  const loaded = () => page.evaluate(() => globalThis.pointwright.status.loadedSamples);
  const counts = page.locator('[data-status="samples"]');
  const canvas = page.locator("canvas.viewport-canvas");
  await canvas.focus();
  await page.keyboard.press("g");
  await page.getByLabel("Resample", { exact: true }).check();
  await page.locator("summary", { hasText: "Resampling" }).click();

  const bound = page.getByLabel("Bound", { exact: true });
  await bound.fill("1");
  assert.match(
    await page.locator('[data-part="resampling"] .obstacle').first().textContent(),
    /1\.05 and 16/,
  );
  await bound.fill("1.4");
  await page.getByLabel("Move by X").fill("1.6");
  await page.waitForFunction(
    (before) => globalThis.pointwright.status.loadedSamples > before,
    session.sample_count,
    { timeout: waitMs },
  );
  await waitForIdle(page, waitMs);
  const previewed = await loaded();
  const badge = page.locator('[data-status="badge"]');
  assert.equal(await badge.textContent(), "Resampled");
  const text = (count) => `8,000 → ${count.toLocaleString("en")} samples`;
  assert.equal(await counts.textContent(), text(previewed));
  assert.equal((await edits()).edits.length, 0, "a preview is not recorded");
  assert.equal((await state()).sample_count, SAMPLES);
  assert.equal(await holes(page), 0, "no holes where it is stretched");

  // Another pull before it: a frame with another count follows.
  await page.getByLabel("Move by X").fill("0.8");
  await page.waitForFunction(
    (before) => globalThis.pointwright.status.loadedSamples !== before && globalThis.pointwright.status.idle,
    previewed,
    { timeout: waitMs },
  );
  const less = await loaded();
  assert.ok(less > SAMPLES && less < previewed, `${less} of ${previewed} samples for half the way`);

  await page.getByLabel("Move by X").fill("1.6");
  await page.getByLabel("Move by X").press("Enter");
  await page.waitForFunction(
    (revision) => globalThis.pointwright.status.revision > revision,
    session.revision + 2,
    { timeout: waitMs },
  );
  await waitForIdle(page, waitMs);
  const { edits: records } = await edits();
  const [record] = records;
  assert.equal(record.edit.resampling.bound, 1.4);
  assert.ok(record.inserted > 500, `${record.inserted} inserted`);
  assert.equal(record.sample_count, SAMPLES + record.inserted - record.removed);
  assert.equal(await loaded(), record.sample_count);
  assert.equal(await counts.textContent(), text(record.sample_count));
  const entry = page.locator(".history-entry").nth(1);
  assert.match(await entry.textContent(), new RegExp(`${record.inserted.toLocaleString("en")} inserted`));
  assert.equal(await holes(page), 0, "no holes after it either");

  await page.getByLabel("Show").selectOption("stretch");
  assert.match(await page.locator(".colour-bar").textContent(), /Stretch of the samples.*1×.*2×.*4×/);
  await page.getByLabel("Show").selectOption("shaded");

  const go = async (keys, head, count) => {
    await canvas.focus();
    await page.keyboard.press(keys);
    await page.waitForFunction((wanted) => globalThis.pointwright.status.loadedSamples === wanted, count, {
      timeout: waitMs,
    });
    await waitForIdle(page, waitMs);
    assert.equal((await edits()).head, head);
    assert.equal((await state()).sample_count, count);
  };
  await go("Control+z", 0, SAMPLES);
  assert.equal(await counts.textContent(), "8,000 samples");
  assert.equal(await holes(page), 0);
  await go("Control+Shift+Z", 1, record.sample_count);
  assert.equal(await counts.textContent(), text(record.sample_count));

  await page.reload();
  await waitForIdle(page, waitMs);
  assert.equal(await loaded(), record.sample_count);
  await page.keyboard.press("g");
  assert.ok(await page.getByLabel("Resample", { exact: true }).isChecked(), "remembered for the session");
  await close();
});
