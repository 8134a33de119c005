// clang-tidy over every C++ source, remembered by content.
//
// Most of clang-tidy's time goes into the system's headers, so sources with the same flags are checked several at a time:
// a batch is a file that includes them all. Sources that define a name in common at namespace scope never share a batch.
// A source that passed is not checked again until it, a header of ours that it includes, its flags, .clang-tidy or
// clang-tidy itself change.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import {
  contentOf,
  digest,
  inParallel,
  jobs,
  root,
  run,
  trackedFiles,
  withProjectIncludes,
} from "../support/process.mjs";

const tool = "clang-tidy-14";
const batchSize = 8;
/** Tests are asked for their names and little else: the expression templates of their assertions are dear to analyse. */
const testChecks = [
  "-*",
  "readability-identifier-naming",
  "google-build-using-namespace",
  "performance-for-range-copy",
].join(",");
const cache = resolve(root, "build/checks/tidy");

/** The compiler's flags per source, from the release build: everything but the compiler, -o, -c and the file. */
export function compileFlags() {
  const flags = new Map();
  for (const { file, command } of JSON.parse(
    readFileSync(resolve(root, "build/release/compile_commands.json"), "utf8"),
  )) {
    // The commands are written for a shell: a definition's quotes come with backslashes.
    const words = command
      .split(" ")
      .slice(1)
      .map((word) => word.replace(/\\(.)/g, "$1"));
    const kept = words.filter(
      (word, i) => word !== "-c" && word !== "-o" && words[i - 1] !== "-o" && words[i - 1] !== "-c",
    );
    flags.set(file.startsWith(`${root}/`) ? file.slice(root.length + 1) : file, kept);
  }
  return flags;
}

/** Names that a source defines at namespace scope, where clang-format puts definitions into the first column. */
function namesDefined(path) {
  const names = new Set();
  for (const line of contentOf(path).split("\n")) {
    if (
      !/^[A-Za-z_]/.test(line) ||
      /^(namespace|using namespace|return|public|private|TEST_CASE)\b/.test(line)
    )
      continue;
    for (const [, name] of line.matchAll(/\b([A-Za-z_]\w*)\s*(?=[({=;[]|$)/g)) names.add(name);
  }
  return names;
}

function batches(sources, flags) {
  const all = [];
  // As many batches as there are processors, at least: two half batches in parallel beat a whole one alone.
  const size = Math.max(1, Math.min(batchSize, Math.ceil(sources.length / jobs)));
  for (const path of sources) {
    const key = [path.startsWith("tests/") ? `--checks=${testChecks}` : "--quiet", ...flags.get(path)].join(
      " ",
    );
    const names = namesDefined(path);
    const fits = (batch) =>
      batch.key === key && batch.paths.length < size && ![...names].some((name) => batch.names.has(name));
    let batch = all.find(fits);
    if (!batch) {
      batch = { key, paths: [], names: new Set() };
      all.push(batch);
    }
    batch.paths.push(path);
    for (const name of names) batch.names.add(name);
  }
  return all;
}

async function check({ paths, key }) {
  const unit = resolve(cache, `${digest(...paths)}.cpp`);
  writeFileSync(unit, paths.map((path) => `#include "${path}"\n`).join(""));
  const [option, ...flags] = key.split(" ").filter((flag) => flag !== "-Werror");
  const { status, output } = await run(
    tool,
    ["--quiet", option, unit, "--", ...flags, "-Wno-unknown-warning-option"],
    {
      cwd: resolve(root, "build/release"),
    },
  );
  const text = output
    .split("\n")
    .filter(
      (line) =>
        !/^\d+ warnings? (and \d+ errors? )?generated|^Suppressed|^Use -header-filter|warnings treated as errors$/.test(
          line,
        ),
    )
    .join("\n")
    .replaceAll(`${root}/`, "");
  return { status, text };
}

export async function tidy() {
  mkdirSync(cache, { recursive: true });
  const flags = compileFlags();
  const version = (await run(tool, ["--version"])).output;
  const config = contentOf(".clang-tidy");
  const sources = (await trackedFiles(/\.cpp$/)).filter((path) => flags.has(path));
  const stamps = new Map(
    sources.map((path) => {
      const texts = withProjectIncludes(path).map(contentOf);
      return [
        path,
        resolve(cache, `${digest(version, config, testChecks, flags.get(path).join(" "), ...texts)}.ok`),
      ];
    }),
  );
  const due = sources.filter((path) => !existsSync(stamps.get(path)));

  const complaints = new Set();
  await inParallel(batches(due, flags), async (batch) => {
    let outcomes = [{ paths: batch.paths, ...(await check(batch)) }];
    // Sources that do not compile together (a clash that the names did not show) are checked one by one.
    if (batch.paths.length > 1 && outcomes[0].text.includes("clang-diagnostic-error")) {
      outcomes = [];
      for (const path of batch.paths)
        outcomes.push({ paths: [path], ...(await check({ paths: [path], key: batch.key })) });
    }
    for (const { paths, status, text } of outcomes) {
      if (status !== 0) complaints.add(text.trim());
      for (const path of paths) {
        const clean = status === 0 || !withProjectIncludes(path).some((part) => text.includes(`${part}:`));
        if (clean && (status === 0 || /: (error|warning): /.test(text)))
          writeFileSync(stamps.get(path), path);
      }
    }
  });
  const notes = `${sources.length} sources, ${due.length} of them new or changed`;
  if (complaints.size === 0) return { passed: 1, failed: 0, output: notes };
  return { passed: 0, failed: 1, output: `${[...complaints].join("\n\n")}\n${notes}` };
}
