// The built viewer: small enough, and nothing in it that the content security policy or a sub-path would break.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { resolve } from "node:path";
import test from "node:test";
import { gzipSync } from "node:zlib";
import { root } from "./support.mjs";

const dist = resolve(root, "web/dist");
const scriptBudget = 200_000;

const files = () =>
  readdirSync(dist, { recursive: true, withFileTypes: true }).filter((entry) => entry.isFile());
const read = (entry) => readFileSync(resolve(entry.parentPath ?? entry.path, entry.name));

test("the scripts stay within 200 kB, compressed", () => {
  const scripts = files().filter(({ name }) => name.endsWith(".js"));
  assert.ok(scripts.length > 0);
  const bytes = scripts.reduce((sum, entry) => sum + gzipSync(read(entry), { level: 9 }).length, 0);
  assert.ok(bytes <= scriptBudget, `${bytes} bytes`);
});

test("the page has no inline script or style and no address that a sub-path would break", () => {
  const page = readFileSync(resolve(dist, "index.html"), "utf8");
  assert.doesNotMatch(page, /<style|\sstyle=|\son[a-z]+=/);
  assert.doesNotMatch(page, /<script(?![^>]*\ssrc=)/);
  assert.doesNotMatch(page, /(?:src|href)="(?:\/|https?:)/);
});

test("no script makes code of text, and no file names another host", () => {
  for (const entry of files()) {
    const text = read(entry).toString("utf8");
    assert.doesNotMatch(text, /\beval\(|new Function\(/, entry.name);
    const hosts = [...text.matchAll(/https?:\/\/([a-z0-9.-]+)/g)].map(([, host]) => host);
    // The SVG name space is a name, and three.js' messages name its own pages; none of them is fetched.
    const strange = hosts.filter(
      (host) => !["www.w3.org", "threejs.org", "github.com", "jcgt.org"].includes(host),
    );
    assert.deepEqual(strange, [], entry.name);
  }
});
