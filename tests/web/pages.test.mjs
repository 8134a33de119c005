// The page of the clouds, refusals, and what assistive technology meets.
import assert from "node:assert/strict";
import { test } from "node:test";
import { waitForIdle } from "../../web/scripts/browser.mjs";
import {
  capsulePly,
  checkTroubles,
  createSession,
  json,
  open,
  seriousFindings,
  service,
  sessionUrl,
  startAroundTests,
  timeout,
  waitMs,
} from "./support.mjs";

startAroundTests();

test("an uploaded file becomes a cloud and opens its session", { timeout }, async () => {
  const { page, troubles } = await open(`${service.url}/`);
  await page.getByText("No clouds yet").waitFor();
  const file = { name: "capsule.ply", mimeType: "application/octet-stream", buffer: capsulePly(5000) };
  await page.locator('input[type="file"]').setInputFiles(file);
  await page.waitForURL(/session=/, { timeout: waitMs });
  await waitForIdle(page, waitMs);
  const { loadedSamples } = await page.evaluate(() => globalThis.pointwright.status);
  assert.equal(loadedSamples, 5000);
  assert.equal(await page.locator("h1").textContent(), "capsule.ply");
  await page.getByRole("link", { name: /Pointwright/ }).click();
  const card = page.locator(".cloud-card");
  await card.waitFor();
  assert.match(await card.textContent(), /5,000 samples/);
  await card.locator(".session-link").click();
  await waitForIdle(page, waitMs);
  await checkTroubles(page, troubles);
  await page.close();
});

test("a file that is no cloud is refused with its reason", { timeout }, async () => {
  const { page } = await open(`${service.url}/`);
  const file = {
    name: "broken.ply",
    mimeType: "application/octet-stream",
    buffer: capsulePly(5000).subarray(0, 30_000),
  };
  await page.locator('input[type="file"]').setInputFiles(file);
  const card = page.locator(".problem-card");
  await card.waitFor({ timeout: waitMs });
  const text = await card.textContent();
  assert.match(text, /broken\.ply was not taken/);
  assert.match(text, /Request /);
  await page.close();
});

test("a session that does not exist is told, with a way back", { timeout }, async () => {
  const { page } = await open(`${service.url}/?session=AAAAAAAAAAAAAAAAAAAAAA`);
  await page.locator(".progress-card.failed").waitFor({ timeout: waitMs });
  assert.equal(await page.evaluate(() => globalThis.pointwright.status.state), "failed");
  await page.getByRole("link", { name: "All clouds" }).click();
  await page.getByRole("heading", { name: "On this server" }).waitFor();
  await page.close();
});

test("clouds and sessions are deleted at the second press only", { timeout }, async () => {
  const session = await createSession(service, 2000);
  const { page } = await open(`${service.url}/`);
  const card = page.locator(`[data-cloud="${session.cloud}"]`);
  const press = async () => card.locator(".session-row .delete").click();
  await press();
  await page.waitForTimeout(200);
  assert.ok((await json(`${service.url}/v1/sessions`)).sessions.some(({ id }) => id === session.id));
  await press();
  await card.locator(".session-row").waitFor({ state: "detached", timeout: waitMs });
  assert.ok(!(await json(`${service.url}/v1/sessions`)).sessions.some(({ id }) => id === session.id));
  await page.close();
});

test("a session is begun on as many samples as the field says", { timeout }, async () => {
  const whole = await createSession(service, 4000);
  const { page, troubles } = await open(`${service.url}/`);
  const card = page.locator(`[data-cloud="${whole.cloud}"]`);
  const field = card.getByLabel("Samples");
  assert.equal(await field.inputValue(), "4,000");
  await field.fill("none");
  await card.getByRole("button", { name: "New session" }).click();
  await card.getByText("a whole number").waitFor();
  await field.fill("1,500");
  await card.getByRole("button", { name: "New session" }).click();
  await page.waitForURL(/session=/, { timeout: waitMs });
  await waitForIdle(page, waitMs);
  assert.equal((await page.evaluate(() => globalThis.pointwright.status)).loadedSamples, 1500);
  assert.match(
    await page.locator('[data-status="samples"]').textContent(),
    /1,500 samples, a preview of 4,000/,
  );
  await checkTroubles(page, troubles);
  await page.close();
});

test("an automatic audit finds nothing serious on the pages", { timeout }, async () => {
  const session = await createSession(service, 3000);
  const home = await open(`${service.url}/`);
  await home.page.locator(".cloud-card").first().waitFor();
  assert.deepEqual(await seriousFindings(home.page), []);
  await home.page.close();
  const editor = await open(sessionUrl(service, session));
  await waitForIdle(editor.page, waitMs);
  assert.deepEqual(await seriousFindings(editor.page), []);
  await editor.page.keyboard.press("o");
  await editor.page.keyboard.press("w");
  for (const name of [
    "Saved regions",
    "Shape by numbers",
    "Regions from an image",
    "Regions from another model",
  ])
    await editor.page.locator("summary", { hasText: name }).click();
  await editor.page.getByText("Save region", { exact: true }).waitFor();
  await editor.page.getByText("Choose a PNG").waitFor();
  await editor.page.getByText("Apply model").waitFor();
  await editor.page.locator('[data-region="one"] [aria-controls]').click();
  assert.deepEqual(await seriousFindings(editor.page), []);
  await editor.page.locator("canvas.viewport-canvas").focus();
  await editor.page.keyboard.press("g");
  await editor.page.locator("summary", { hasText: "Playback and recipe" }).click();
  await editor.page.getByLabel("Resample", { exact: true }).check();
  await editor.page.locator("summary", { hasText: "Resampling" }).click();
  await editor.page.getByLabel("Clean up afterwards").check();
  await editor.page.getByLabel("Bound", { exact: true }).fill("99");
  assert.deepEqual(await seriousFindings(editor.page), []);
  await editor.page.locator("canvas.viewport-canvas").focus();
  await editor.page.keyboard.press("?");
  await editor.page.locator("dialog[open]").waitFor();
  assert.deepEqual(await seriousFindings(editor.page), []);
  await editor.page.keyboard.press("Escape");
  await checkTroubles(editor.page, editor.troubles);
  await editor.page.close();
});
