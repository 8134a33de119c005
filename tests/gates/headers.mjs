// Every header compiles alone: whoever includes it needs nothing before it. The build cannot show it, for it gives each source
// the precompiled headers. They are compiled here without those, and remembered by content, as clang-tidy's sources are.
import { existsSync, mkdirSync, writeFileSync } from "node:fs";
import { dirname, resolve } from "node:path";
import {
  contentOf,
  digest,
  inParallel,
  root,
  run,
  trackedFiles,
  verdict,
  withProjectIncludes,
} from "../support/process.mjs";
import { compileFlags } from "./tidy.mjs";

const cache = resolve(root, "build/checks/headers");

/** The flags of a source in the header's folder, else of the nearest folder above that has one. */
function flagsFor(header, flags) {
  for (let folder = dirname(header); ; folder = dirname(folder)) {
    const source = [...flags.keys()].find(
      (path) => (folder === "." || path.startsWith(`${folder}/`)) && flags.get(path).includes(`-I${root}`),
    );
    if (source) return flags.get(source);
    if (folder === ".") throw new Error("the release build has no sources");
  }
}

export async function headers() {
  mkdirSync(cache, { recursive: true });
  const flags = await compileFlags();
  const version = (await run("g++", ["--version"])).output;
  const complaints = [];
  const paths = await trackedFiles(/^(engine|protocol|server|tests)\/.*\.h$/);
  await inParallel(paths, async (path) => {
    const words = flagsFor(path, flags);
    const stamp = resolve(
      cache,
      `${digest(path, version, words.join(" "), ...withProjectIncludes(path).map(contentOf))}.ok`,
    );
    if (existsSync(stamp)) return;
    const unit = resolve(cache, `${digest(path)}.cpp`);
    writeFileSync(unit, `#include "${path}"\n#include "${path}"\n`);
    const { status, output } = await run("g++", [...words, "-Wno-unused-function", "-fsyntax-only", unit], {
      cwd: resolve(root, "build/release"),
    });
    if (status === 0) writeFileSync(stamp, path);
    else complaints.push(`${path} does not compile alone:\n${output.trim()}`);
  });
  return verdict(complaints, "A header includes what it uses.");
}
