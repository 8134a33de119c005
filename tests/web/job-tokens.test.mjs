// Jobs where tokens are in use: events and results come with the token, and guests of a share link see none.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { daemonPath } from "../../web/demo/daemon.mjs";
import {
  capsulePly,
  checkTroubles,
  json,
  open,
  service,
  startAroundTests,
  timeout,
  until,
  waitMs,
} from "./support.mjs";

const folder = mkdtempSync(join(tmpdir(), "pointwright-tokens-"));
const tokens = join(folder, "tokens.json");
const add = ["token", "--tokens", tokens, "add", "ann", "--scope", "edit"];
const token = execFileSync(daemonPath, add, { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] }).trim();
startAroundTests(["--tokens", tokens]);
after(() => rmSync(folder, { recursive: true, force: true }));

const samples = 6000;

const ask = (path, init = {}) =>
  json(`${service.url}/v1/${path}`, {
    ...init,
    headers: { Authorization: `Bearer ${token}`, ...init.headers },
  });
const post = (path, body, headers = {}) =>
  ask(path, {
    method: "POST",
    headers: { "Content-Type": "application/json", ...headers },
    body: JSON.stringify(body),
  });

/** A session on a part of a capsule whose right cap was lifted. */
async function liftedSession() {
  const cloud = await ask("clouds?name=capsule.ply", {
    method: "POST",
    headers: { "Content-Type": "application/x-ply" },
    body: capsulePly(samples),
  });
  const { id } = await post("sessions", { cloud: cloud.id, name: "Capsule", preview: { count: 2000 } });
  await until(async () => (await ask(`sessions/${id}`)).state === "ready", "the session is not ready");
  for (const [region, from, to] of [
    ["zero", -3, -0.7],
    ["one", 0.7, 3],
  ])
    await post(`sessions/${id}/regions/${region}/operations`, {
      mode: "add",
      shape: { type: "box", min: [from, -3, -3], max: [to, 3, 3] },
    });
  const deformation = { type: "translation", vector: [0, 0.3, 0] };
  await post(`sessions/${id}/edits`, { level: 0, deformation }, { "If-Match": "*" });
  return id;
}

test("a job is followed and its result fetched with the token, and a guest has no jobs", {
  timeout,
}, async () => {
  const session = await liftedSession();
  const { capability } = await post(`sessions/${session}/shares`, { scope: "edit" });
  const link = (secret) => `${service.url}/#s=${session}&k=${secret}`;
  const { page, troubles } = await open(link(token));
  await page.getByRole("button", { name: "Full resolution…" }).click();
  const events = page.waitForResponse((response) => response.url().endsWith("/events"));
  await page.getByRole("button", { name: "Start", exact: true }).click();
  assert.equal((await events).status(), 200);
  const result = page.getByRole("link", { name: /^Download PLY/ });
  await result.waitFor({ timeout: waitMs });
  const [download] = await Promise.all([page.waitForEvent("download"), result.click()]);
  assert.equal(download.suggestedFilename(), "Capsule.ply");
  assert.match(
    readFileSync(await download.path()).toString("latin1", 0, 200),
    new RegExp(`element vertex ${samples}\n`),
  );
  await checkTroubles(page, troubles);
  await page.close();

  // A page of its own: the token is the tab's.
  const guest = await open(link(capability));
  await guest.page.getByRole("button", { name: "Full resolution…" }).click();
  await guest.page.getByText("A share link opens this session alone").waitFor();
  assert.equal(await guest.page.getByRole("button", { name: "Start", exact: true }).count(), 0);
  const asked = [];
  guest.page.on("request", (request) => asked.push(request.url()));
  await guest.page.goto(`${service.url}/`);
  await guest.page.getByRole("heading", { name: "On this server" }).waitFor();
  assert.ok(await guest.page.locator(".home-jobs").isHidden());
  assert.deepEqual(
    asked.filter((url) => url.includes("/v1/jobs")),
    [],
  );
  await checkTroubles(guest.page, guest.troubles);
  await guest.page.close();
});
