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
const scripts = () => files().filter(({ name }) => name.endsWith(".js"));

/** Of a script: the names of those that it needs at once, and of those that it asks for when they are wanted. */
function importsOf(text) {
  const names = (pattern) => [...text.matchAll(pattern)].map(([, name]) => name);
  return {
    now: names(/(?:from|import)\s*["']\.\/([\w.-]+\.js)["']/g),
    later: names(/import\(\s*["'`]\.\/([\w.-]+\.js)["'`]\s*\)/g),
  };
}

test("what opens a session stays within 200 kB of scripts, compressed; rarely used panels come later", () => {
  const entries = new Map(scripts().map((entry) => [entry.name, read(entry)]));
  const page = readFileSync(resolve(dist, "index.html"), "utf8");
  const [, entry] = /<script[^>]*\ssrc="[^"]*?([\w.-]+\.js)"/.exec(page);
  const editor = [...entries.keys()].filter((name) => name.startsWith("editor-"));
  assert.equal(editor.length, 1);
  assert.ok(importsOf(entries.get(entry).toString()).later.includes(editor[0]));
  const first = new Set();
  const later = new Set();
  const visit = (name) => {
    if (first.has(name)) return;
    first.add(name);
    const imports = importsOf(entries.get(name).toString());
    for (const each of imports.later) later.add(each);
    for (const each of imports.now) visit(each);
  };
  visit(entry);
  visit(editor[0]);
  const bytes = [...first].reduce((sum, name) => sum + gzipSync(entries.get(name), { level: 9 }).length, 0);
  assert.ok(bytes <= scriptBudget, `${bytes} bytes`);
  for (const part of ["home-", "image-form-", "model-form-", "saved-regions-", "shortcut-sheet-"]) {
    const [name] = [...later].filter((each) => each.startsWith(part));
    assert.ok(name && !first.has(name), `${part}*.js is asked for when it is wanted`);
  }
  // What comes later may ask for more, later still.
  for (const name of later) {
    if (first.has(name)) continue;
    const imports = importsOf(entries.get(name).toString());
    for (const each of [...imports.now, ...imports.later]) if (!first.has(each)) later.add(each);
  }
  // Nothing lies about that no page asks for.
  assert.deepEqual(
    [...entries.keys()].filter((name) => !first.has(name) && !later.has(name)),
    [],
  );
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
