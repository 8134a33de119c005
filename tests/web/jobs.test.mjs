// Jobs at full resolution: begun, followed and collected by hand, and met on the page of the clouds.
import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import {
  capsulePly,
  checkTroubles,
  json,
  open,
  openEditor,
  paintCaps,
  seriousFindings,
  service,
  startAroundTests,
  timeout,
  waitForRevision,
  waitMs,
} from "./support.mjs";

// A launcher that holds its workers until let go, and one that fails.
const folder = mkdtempSync(join(tmpdir(), "pointwright-jobs-"));
const gate = join(folder, "gate");
const hold = join(folder, "hold.sh");
writeFileSync(hold, `while [ ! -e ${gate} ]; do sleep 0.05; done\nexec "$@"\n`);
startAroundTests(["--launcher", `held=sh ${hold} {worker}`, "--launcher", "broken=false {worker}"]);
after(() => rmSync(folder, { recursive: true, force: true }));

const samples = 12_000;

/** An editor on a preview of the capsule whose right cap was lifted by 0.4. */
async function openLifted() {
  const editor = await openEditor(samples, { width: 1100, height: 760 }, 3000);
  const { page, session, state } = editor;
  await paintCaps(session, page);
  const { revision } = await state();
  await json(`${service.url}/v1/sessions/${session.id}/edits`, {
    method: "POST",
    headers: { "Content-Type": "application/json", "If-Match": `"r${revision}"` },
    body: JSON.stringify({ level: 0, deformation: { type: "translation", vector: [0, 0.4, 0] } }),
  });
  await waitForRevision(page, revision + 1);
  const submit = (body) =>
    json(`${service.url}/v1/jobs`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ session: session.id, ...body }),
    });
  return { ...editor, submit };
}

async function openJobs(page) {
  await page.getByRole("button", { name: "Full resolution…" }).click();
  const dialog = page.getByRole("dialog", { name: "Full resolution" });
  await dialog.getByRole("heading", { name: "Jobs of this session" }).waitFor();
  return dialog;
}

/** The row of this name once it has this status. */
async function rowWith(place, name, status) {
  const row = place
    .locator(".job-row")
    .filter({ has: place.page().getByRole("heading", { name, exact: true }) });
  await row.locator(".job-status", { hasText: status }).waitFor({ timeout: waitMs });
  return row;
}

/** Positions of a binary PLY whose vertices begin with three floats. */
function positionsOf(bytes) {
  const end = bytes.indexOf("end_header\n") + "end_header\n".length;
  const header = bytes.toString("latin1", 0, end);
  const count = Number(/element vertex (\d+)/.exec(header)[1]);
  const size = (bytes.length - end) / count;
  return Array.from({ length: count }, (_, i) =>
    [0, 4, 8].map((at) => bytes.readFloatLE(end + size * i + at)),
  );
}

test("an edit is estimated, made on every sample of the scan, and downloaded", { timeout }, async () => {
  const bare = await openEditor(3000);
  const none = await openJobs(bare.page);
  await none.getByText("There is no edit yet").waitFor();
  assert.ok(await none.getByRole("button", { name: "Start", exact: true }).isDisabled());
  assert.ok(await none.getByRole("button", { name: "Estimate" }).isDisabled());
  await bare.page.keyboard.press("Escape");
  await none.waitFor({ state: "detached" });
  await bare.close();

  const { page, close } = await openLifted();
  const dialog = await openJobs(page);
  assert.match(
    await dialog.getByLabel("Scan", { exact: true }).textContent(),
    /capsule\.ply · 12,000 samples/,
  );
  assert.match(await dialog.getByLabel("Format of the result").textContent(), /As the scan \(PLY\)/);
  await dialog.getByLabel("Way").selectOption("In memory");
  await dialog.getByText("The whole scan at once").waitFor();
  await dialog.getByRole("button", { name: "Estimate" }).click();
  const facts = dialog.locator(".job-facts");
  await facts.waitFor();
  assert.match(await facts.textContent(), /Samples12,000.*Disk.* free.*WayIn memory/);
  await dialog.getByLabel("Way").selectOption("Automatic");
  assert.equal(await facts.count(), 0, "an estimate of something else is gone");
  await dialog.getByLabel("Name").fill("The capsule");
  await dialog.getByRole("button", { name: "Start", exact: true }).click();

  const row = await rowWith(dialog, "The capsule", "Finished");
  const text = await row.textContent();
  const [, moved] = /([\d,]+) of 12,000 samples moved in/.exec(text);
  assert.match(text, /The preview showed it within 0\.\d+ of a spacing/);
  assert.match(text, /PLY · in tiles/);
  assert.ok(await row.locator("progress").isHidden());
  const link = row.getByRole("link", { name: /^Download PLY .*, The capsule\.ply$/ });
  const [download] = await Promise.all([page.waitForEvent("download"), link.click()]);
  assert.equal(download.suggestedFilename(), "The-capsule.ply");
  const before = positionsOf(capsulePly(samples));
  const now = positionsOf(readFileSync(await download.path()));
  assert.equal(now.length, samples);
  const lifts = now.map(([x, y, z], i) => {
    const [, rest] = before[i];
    const isSame = x === before[i][0] && y === rest && z === before[i][2];
    return isSame ? 0 : y - rest;
  });
  assert.equal(lifts.filter((lift) => lift !== 0).length, Number(moved.replaceAll(",", "")));
  for (const [i, [x]] of before.entries()) {
    if (x < -0.75) assert.equal(lifts[i], 0, `the sample at x = ${x} stays`);
    if (x > 0.75) assert.ok(Math.abs(lifts[i] - 0.4) < 0.01, `the sample at x = ${x} rose by ${lifts[i]}`);
  }

  await row.getByRole("button", { name: "Log of The capsule" }).click();
  const log = row.getByRole("region", { name: "Log of The capsule" });
  await log.getByText(/attempt 1, [\s\S]*successful/).waitFor();
  assert.equal(await log.getAttribute("aria-live"), "off");

  const count = dialog.getByLabel("Animation");
  await count.fill("1");
  await dialog.getByText("An animation has 2 to 1,000 clouds.").waitFor();
  assert.ok(await dialog.getByRole("button", { name: "Start", exact: true }).isDisabled());
  await count.fill("3");
  await dialog.getByLabel("Name").fill("In motion");
  await dialog.getByRole("button", { name: "Start", exact: true }).click();
  const moving = await rowWith(dialog, "In motion", "Finished");
  const frames = moving.locator(".job-frames a");
  await frames.nth(2).waitFor();
  const names = await frames.evaluateAll((links) => links.map(({ download: name }) => name));
  assert.deepEqual(names, ["In motion_0001.ply", "In motion_0002.ply", "In motion_0003.ply"]);
  const [half] = await Promise.all([
    page.waitForEvent("download"),
    moving.getByRole("link", { name: /^No\. 2 / }).click(),
  ]);
  assert.equal(half.suggestedFilename(), "In-motion_0002.ply");
  const middle = positionsOf(readFileSync(await half.path()));
  for (const [i, [x, y]] of before.entries())
    if (x > 0.75) assert.ok(Math.abs(middle[i][1] - y - 0.2) < 0.01, "half of the way in the middle");
  assert.deepEqual(await seriousFindings(page), []);
  await close();
  const [newest] = (await json(`${service.url}/v1/jobs`)).jobs;
  assert.equal(newest.request.name, "In motion");
  await json(`${service.url}/v1/jobs/${newest.jobID}`, { method: "DELETE" });

  const home = await open(`${service.url}/`);
  const section = home.page.getByRole("region", { name: "Jobs", exact: true });
  const there = await rowWith(section, "The capsule", "Finished");
  assert.match(await there.textContent(), /12,000 samples moved/);
  assert.deepEqual(await seriousFindings(home.page), []);
  const forget = there.getByRole("button", { name: /^Forget The capsule/ });
  await forget.click();
  assert.equal((await json(`${service.url}/v1/jobs`)).jobs.length, 1, "one press only asks");
  await forget.click();
  await section.waitFor({ state: "hidden", timeout: waitMs });
  assert.equal((await json(`${service.url}/v1/jobs`)).jobs.length, 0);
  await checkTroubles(home.page, home.troubles);
  await home.page.close();
});

test("a scan that is no cloud is sent for a job alone, by a launcher, and comes back as Draco tiles", {
  timeout,
}, async () => {
  const { page, close } = await openLifted();
  const dialog = await openJobs(page);
  await dialog.getByLabel("send the whole scan").setInputFiles({
    name: "whole.ply",
    mimeType: "application/octet-stream",
    buffer: capsulePly(samples),
  });
  const scan = dialog.getByLabel("Scan", { exact: true });
  await scan.getByRole("option", { name: /^whole\.ply · .*as it came$/ }).waitFor({ state: "attached" });
  assert.match(await scan.evaluate((select) => select.selectedOptions[0].text), /^whole\.ply/);
  await dialog.getByLabel("Format of the result").selectOption("Draco tiles");
  const launchers = dialog.getByLabel("Started by");
  assert.equal(await launchers.inputValue(), "local");
  await launchers.selectOption("held");
  await dialog.getByRole("button", { name: "Estimate" }).click();
  await dialog.locator(".job-facts").waitFor();
  await dialog.getByLabel("Name").fill("The whole");
  await dialog.getByRole("button", { name: "Start", exact: true }).click();
  await rowWith(dialog, "The whole", "Running");
  writeFileSync(gate, "");
  const row = await rowWith(dialog, "The whole", "Finished");
  rmSync(gate);
  assert.match(await row.textContent(), /Draco tiles · in tiles · .*held/);
  const link = row.getByRole("link", { name: /^Download Draco tiles .*, The whole\.zip$/ });
  const [download] = await Promise.all([page.waitForEvent("download"), link.click()]);
  assert.equal(readFileSync(await download.path()).toString("latin1", 30, 39), "index.csv");
  // It is there for the next job, too.
  await page.keyboard.press("Escape");
  await dialog.waitFor({ state: "detached" });
  const again = await openJobs(page);
  await again
    .getByLabel("Scan", { exact: true })
    .selectOption({ label: await again.getByRole("option", { name: /^whole\.ply/ }).textContent() });
  await close();
});

test("jobs are followed live, dismissed, started again, and a failure says why", { timeout }, async () => {
  const { page, submit, close } = await openLifted();
  const held = await submit({ launcher: "held", name: "Held" });
  await submit({ launcher: "broken", name: "Broken", priority: 9 });
  const streams = [];
  page.on("request", (request) => {
    if (request.url().endsWith("/events")) streams.push(request);
  });
  const dialog = await openJobs(page);
  const row = await rowWith(dialog, "Held", "Running");
  await row.locator("progress").waitFor();
  assert.equal(streams.length > 0, true, "events are listened to");
  await row.getByRole("button", { name: "Log of Held" }).click();
  await row.getByText(/attempt 1,/).waitFor();
  assert.deepEqual(await seriousFindings(page), []);

  const dismiss = row.getByRole("button", { name: /^Dismiss Held/ });
  await dismiss.click();
  assert.equal((await json(`${service.url}/v1/jobs/${held.jobID}`)).status, "running", "one press only asks");
  assert.equal(await dismiss.textContent(), "Press again");
  await dismiss.click();
  await rowWith(dialog, "Held", "Dismissed");
  const broken = await rowWith(dialog, "Broken", "Failed");
  assert.ok((await broken.locator(".job-failure").textContent()).length > 10, "the failure has a reason");
  await broken.getByRole("button", { name: "Start again: Broken" }).waitFor();

  await row.getByRole("button", { name: "Start again: Held" }).click();
  await rowWith(dialog, "Held", "Running");
  // A proxy's page in the place of the list.
  const notThere = { status: 200, contentType: "text/html", body: "<p>Back soon" };
  await page.route(`**/v1/jobs/${held.jobID}/results`, (route) => route.fulfill(notThere), { times: 1 });
  writeFileSync(gate, "go");
  await rowWith(dialog, "Held", "Finished");
  await row.getByText("The results cannot be listed").waitFor();
  assert.equal(await row.getByRole("link", { name: /^Download/ }).count(), 0);
  await row.getByRole("button", { name: "List the results of Held again" }).click();
  await row.getByText(/dismissed[\s\S]*attempt [\s\S]*successful/).waitFor();
  await row.getByRole("link", { name: /^Download PLY .*, Held\.ply$/ }).waitFor();

  // What was under way is let go with the window.
  rmSync(gate);
  const again = await submit({ launcher: "held", name: "Again" });
  await rowWith(dialog, "Again", "Running");
  const failed = page.waitForEvent("requestfailed", {
    predicate: (request) => request.url().endsWith(`${again.jobID}/events`),
  });
  await dialog.getByRole("button", { name: "Close" }).click();
  await failed;
  writeFileSync(gate, "go");
  await close();
});
