// Canonical form: clang-format for C++, Biome (format and lint) for TypeScript and JavaScript, bash -n for shell scripts.
import { resolve } from "node:path";
import { contentOf, root, run, together, trackedFiles, verdict } from "../support/process.mjs";

/** Comments that pass the column limit: clang-format is told to leave comments as they stand. */
function longComments(paths) {
  const limit = Number(contentOf(".clang-format").match(/^ColumnLimit: (\d+)$/m)[1]);
  return paths.flatMap((path) =>
    contentOf(path)
      .split("\n")
      .map((line, i) => ({ line, place: `${path}:${i + 1}` }))
      .filter(({ line }) => line.length > limit && /^[^"]*\/\//.test(line))
      .map(({ place }) => `${place}: a comment passes column ${limit}`),
  );
}

async function cpp() {
  const paths = await trackedFiles(/\.(h|cpp|inc)$/);
  const { status, output } = await run("clang-format-14", ["--dry-run", "--Werror", ...paths]);
  const files = new Set([...output.matchAll(/^(\S+?):\d+:\d+: error/gm)].map(([, path]) => path));
  if (status !== 0 && files.size === 0) return verdict([output]);
  return together([
    verdict(
      [...files].map((path) => `${path} is not in clang-format's form`),
      "`make format` puts them right.",
    ),
    verdict(longComments(paths)),
  ]);
}

/** Biome once per configuration: the viewer's folder, and the scripts of the tests. */
async function web(folder) {
  const biome = resolve(root, "web/node_modules/@biomejs/biome/bin/biome");
  const { status, output } = await run("node", [biome, "check", "--colors=off"], {
    cwd: resolve(root, folder),
  });
  return verdict(status === 0 ? [] : [output.trim()], "`make format` puts most of it right.");
}

async function shell() {
  const complaints = [];
  for (const path of await trackedFiles(/^[^.]*$|\.sh$|^\.ci\/|^\.githooks\//)) {
    if (!/^#!.*\b(bash|sh)\b/.test(contentOf(path))) continue;
    const { status, output } = await run("bash", ["-n", path]);
    if (status !== 0) complaints.push(`${path}: ${output.trim()}`);
    if (!/^set -euo pipefail$/m.test(contentOf(path))) complaints.push(`${path} lacks 'set -euo pipefail'`);
  }
  return verdict(complaints);
}

export async function format() {
  return together([await cpp(), await web("web"), await web("tests"), await shell()]);
}
