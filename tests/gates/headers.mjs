// Every header compiles alone: whoever includes it needs nothing of ours before it. A header that a compiled file includes
// before anything else has been compiled alone by the build; the others are compiled here, with the build's precompiled
// headers where there are any, and what passed is remembered by content, as clang-tidy's sources are. Of the standard library
// a header names what it uses itself: that is looked for in the text, because compiling shows it badly (the library's headers
// include each other) and with precompiled headers not at all.
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
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

/** What the standard library declares where; only names that no other header promises. */
const declaredIn = {
  algorithm:
    /\bstd::(?:ranges::)?(?:sort|find_if|transform|all_of|any_of|none_of|count_if|clamp|min_element|max_element)\b/,
  array: /\bstd::array\b/,
  atomic: /\bstd::atomic\b/,
  chrono: /\bstd::chrono\b/,
  condition_variable: /\bstd::condition_variable\b/,
  cstdint: /\bstd::u?int(?:8|16|32|64)_t\b/,
  deque: /\bstd::deque\b/,
  functional: /\bstd::function\b/,
  future: /\bstd::(?:future|promise|packaged_task)\b/,
  list: /\bstd::list\b/,
  map: /\bstd::(?:multi)?map\b/,
  memory: /\bstd::(?:unique_ptr|shared_ptr|weak_ptr|make_unique|make_shared|enable_shared_from_this)\b/,
  mutex: /\bstd::(?:mutex|lock_guard|unique_lock|scoped_lock)\b/,
  optional: /\bstd::(?:optional|nullopt)\b/,
  set: /\bstd::set\b/,
  span: /\bstd::(?:span|as_bytes)\b/,
  string: /\bstd::(?:string|to_string)\b/,
  string_view: /\bstd::string_view\b/,
  thread: /\bstd::(?:thread|jthread|this_thread)\b/,
  unordered_map: /\bstd::unordered_map\b/,
  utility: /\bstd::(?:pair|exchange)\b/,
  variant: /\bstd::(?:variant|monostate|visit)\b/,
  vector: /\bstd::vector\b/,
};

/** Headers of the standard library that a header uses and does not include. */
function missingIncludes(path) {
  const text = contentOf(path);
  const code = text.replace(/\/\/.*|\/\*[\s\S]*?\*\//g, "");
  const included = new Set([...text.matchAll(/^#include <(\w+)>/gm)].map(([, name]) => name));
  return Object.entries(declaredIn)
    .filter(([name, use]) => !included.has(name) && use.test(code))
    .map(([name]) => name);
}

/** The first file that a source includes, as it is written there. */
const firstInclude = (path) => contentOf(path)?.match(/^\s*#\s*include\s+["<](.*)[">]/m)?.[1];

/** The headers that the release build has compiled alone: those that begin a batch, or a source in none. */
function compiledAlone() {
  const commands = resolve(root, "build/release/compile_commands.json");
  if (!existsSync(commands)) return new Set();
  return new Set(
    JSON.parse(readFileSync(commands, "utf8")).map(({ file }) => {
      const source = file.includes("/Unity/") ? readFileSync(file, "utf8").match(/#include "(.*)"/)[1] : file;
      return firstInclude(source.replace(`${root}/`, ""));
    }),
  );
}

export async function headers() {
  mkdirSync(cache, { recursive: true });
  const flags = await compileFlags({ precompiled: true });
  const compiled = compiledAlone();
  const version = (await run("g++", ["--version"])).output;
  const complaints = [];
  const paths = await trackedFiles(/^(engine|protocol|server|tests)\/.*\.h$/);
  await inParallel(paths, async (path) => {
    const missing = missingIncludes(path);
    if (missing.length > 0)
      complaints.push(
        `${path} uses what it does not include: ${missing.map((name) => `<${name}>`).join(", ")}`,
      );
    if (compiled.has(path)) return;
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
