// clang-tidy over every C++ source, remembered by content.
//
// Most of clang-tidy's time goes into the system's headers, so sources with the same flags are checked several at a time:
// a batch is a file that includes them all. Sources whose own names would clash never share a batch.
// A source that passed is not checked again until it, a header of ours that it includes, its flags, .clang-tidy or
// clang-tidy itself change.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, resolve } from "node:path";
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
const batchSize = 32;
/** A batch includes sources, and that alone is no finding. */
const sourceChecks = "-bugprone-suspicious-include";
/**
 * Tests are asked for their names and little else: the expression templates of their assertions are dear to analyse, and they
 * open the namespaces that they test.
 */
const testChecks = "-*,readability-identifier-naming,performance-for-range-copy";
const checksFor = (path) => (path.startsWith("tests/") ? testChecks : sourceChecks);
const cache = resolve(root, "build/checks/tidy");

async function configure(...options) {
  const { status, output } = await run("cmake", ["--preset", "release", ...options]);
  if (status !== 0) throw new Error(`the release build cannot be configured:\n${output}`);
}

/**
 * The compiler's flags per source, as the release build has them, which compiles sources in batches: everything but the
 * compiler, -o, -c, the file and, unless asked for, the precompiled headers.
 */
export async function compileFlags({ precompiled = false } = {}) {
  const dropped = precompiled ? ["-c", "-o"] : ["-c", "-o", "-include", "-Winvalid-pch"];
  const apart = resolve(root, "build/checks/flags");
  const release = resolve(root, "build/release");
  await configure("-B", apart, "-DPOINTWRIGHT_BATCHES=OFF");
  if (!existsSync(resolve(release, "build.ninja"))) await configure();
  const commands = readFileSync(resolve(apart, "compile_commands.json"), "utf8");
  const flags = new Map();
  for (const { file, command } of JSON.parse(commands.replaceAll(apart, release))) {
    // The commands are written for a shell: a definition's quotes come with backslashes.
    const words = command
      .split(" ")
      .slice(1)
      .map((word) => word.replace(/\\(.)/g, "$1"));
    const kept = words.filter(
      (word, i) =>
        !dropped.includes(word) && !(dropped.includes(words[i - 1]) && words[i - 1] !== "-Winvalid-pch"),
    );
    flags.set(file.startsWith(`${root}/`) ? file.slice(root.length + 1) : file, kept);
  }
  return flags;
}

/** Per source to check, what the checks see of its flags: macros, search paths, language, machine. */
async function sourcesWithFlags() {
  const flags = await compileFlags();
  const compiled = [...flags.keys()];
  const found = new Map();
  for (const path of await trackedFiles(/\.(cpp|inc)$/)) {
    // A kernel takes the flags of its plainest copy.
    const copy = `/kernels/${basename(path, ".inc")}_simd_base.cpp`;
    const words = flags.get(path.endsWith(".inc") ? compiled.find((file) => file.endsWith(copy)) : path);
    if (!words) continue;
    found.set(
      path,
      words.filter((word, i) => /^-(D|I|isystem|std=|m)/.test(word) || words[i - 1] === "-isystem"),
    );
  }
  return found;
}

const notNames = new Set(["static_assert", "void", "const"]);
const attributes = /__attribute__\(\(.*?\)\)(?!\))|\b(?:alignas|decltype)\(\w*\)/g;
const definitions = new Map();
/**
 * Names that a file defines at namespace scope, where clang-format puts definitions into the first column: all of them, and
 * its own (in an unnamed namespace or in none). Members of classes, `Type::name`, are not among them.
 */
function namesDefined(path) {
  if (definitions.has(path)) return definitions.get(path);
  const all = new Set();
  const own = new Set();
  const named = []; // per open namespace, whether it has a name
  for (const line of contentOf(path).split("\n")) {
    const opened = line.match(/^namespace ?([\w:]*) ?\{$/);
    if (opened) named.push(opened[1] !== "");
    else if (/^\} {2}\/\/ namespace/.test(line)) named.pop();
    if (
      !/^[A-Za-z_]/.test(line) ||
      /^(namespace|using namespace|return|public|private|TEST_CASE)\b/.test(line)
    )
      continue;
    // What is defined is the first name that something opens or ends behind; the rest of the line uses names.
    const name = line.replace(attributes, "").match(/(?<!::)\b([A-Za-z_]\w*)\s*(?=[({=;[]|$)/)?.[1];
    if (!name || notNames.has(name)) continue;
    all.add(name);
    if (named.length === 0 || named.includes(false)) own.add(name);
  }
  definitions.set(path, { all, own });
  return definitions.get(path);
}

/** A source's own names, and every name of the project that it sees. */
function namesOf(path) {
  const seen = withProjectIncludes(path).flatMap((part) => [...namesDefined(part).all]);
  return { own: namesDefined(path).own, seen: new Set(seen) };
}

const meet = (a, b) => [...a].some((name) => b.has(name));
const clash = (a, b) => meet(a.own, b.seen) || meet(b.own, a.seen);

/** Sources in batches, those that take longest first: tests are asked for less. */
function batches(sources, flags) {
  const all = [];
  // As many batches as there are processors, at least: two half batches in parallel beat a whole one alone.
  const size = Math.max(1, Math.min(batchSize, Math.ceil(sources.length / jobs)));
  // Our own macros mean the same in every source that is given them.
  const isOurs = (word) => word.startsWith("-DPOINTWRIGHT_");
  for (const path of sources) {
    const words = flags.get(path);
    const key = JSON.stringify([checksFor(path), ...words.filter((word) => !isOurs(word))]);
    const names = namesOf(path);
    let batch = all.find(
      ({ key: other, paths, names: others }) =>
        key === other && paths.length < size && !others.some((some) => clash(names, some)),
    );
    if (!batch) {
      batch = { key, paths: [], names: [], checks: checksFor(path), flags: words };
      all.push(batch);
    }
    batch.paths.push(path);
    batch.names.push(names);
    batch.flags = [...batch.flags, ...words.filter((word) => isOurs(word) && !batch.flags.includes(word))];
  }
  const cost = ({ paths }) => paths.length * (paths[0].startsWith("tests/") ? 1 : 3);
  return all.sort((a, b) => cost(b) - cost(a));
}

/** Outcomes of a batch: one, or those of its halves where the sources do not compile together (a clash that the names did not show). */
async function check({ paths, checks, flags }) {
  const unit = resolve(cache, `${digest(...paths)}.cpp`);
  writeFileSync(unit, paths.map((path) => `#include "${resolve(root, path)}"\n`).join(""));
  // Whatever runs beside it goes first: tests have deadlines.
  const command = ["-n", "19", tool, "--quiet", `--checks=${checks}`, unit, "--", ...flags, "-w"];
  const { status, output } = await run("nice", command, { cwd: resolve(root, "build/release") });
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
  if (paths.length === 1 || !text.includes("clang-diagnostic-error")) return [{ paths, status, text }];
  const middle = Math.ceil(paths.length / 2);
  return [
    ...(await check({ paths: paths.slice(0, middle), checks, flags })),
    ...(await check({ paths: paths.slice(middle), checks, flags })),
  ];
}

export async function tidy() {
  mkdirSync(cache, { recursive: true });
  const flags = await sourcesWithFlags();
  const version = (await run(tool, ["--version"])).output;
  const config = contentOf(".clang-tidy");
  const sources = [...flags.keys()];
  const stamps = new Map(
    sources.map((path) => {
      const texts = withProjectIncludes(path).map(contentOf);
      return [
        path,
        resolve(cache, `${digest(version, config, checksFor(path), ...flags.get(path), ...texts)}.ok`),
      ];
    }),
  );
  const due = sources.filter((path) => !existsSync(stamps.get(path)));

  const complaints = new Set();
  await inParallel(batches(due, flags), async (batch) => {
    for (const { paths, status, text } of await check(batch)) {
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
