// What the lanes and gates share: running programs, a bounded pool, reading the tracked files, hashing.
import { spawn } from "node:child_process";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { availableParallelism, cpus } from "node:os";
import { dirname, resolve } from "node:path";
import { fileURLToPath } from "node:url";

export const root = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
export const jobs = Number(process.env.JOBS) || (availableParallelism?.() ?? cpus().length);

/** Runs a program to its end in the repository's root. Answers {status, output}; output is stdout and stderr in turn. */
export function run(command, args, { cwd = root, env = {}, timeoutSeconds = 1800 } = {}) {
  return new Promise((done) => {
    const child = spawn(command, args, {
      cwd,
      env: { ...process.env, ...env },
      stdio: ["ignore", "pipe", "pipe"],
    });
    const chunks = [];
    child.stdout.on("data", (chunk) => chunks.push(chunk));
    child.stderr.on("data", (chunk) => chunks.push(chunk));
    const timer = setTimeout(() => {
      chunks.push(Buffer.from(`\n${command}: stopped after ${timeoutSeconds} s\n`));
      child.kill("SIGKILL");
    }, timeoutSeconds * 1000);
    const finish = (status, extra = "") => {
      clearTimeout(timer);
      done({ status, output: Buffer.concat(chunks).toString("utf8") + extra });
    };
    child.on("error", (error) => finish(127, `${command}: ${error.message}\n`));
    child.on("close", (code, signal) =>
      finish(code ?? 1, signal ? `\n${command}: ended by ${signal}\n` : ""),
    );
  });
}

/** Calls work(item) for every item, at most `jobs` at a time. Answers the results in order. */
export async function inParallel(items, work) {
  const results = new Array(items.length);
  let next = 0;
  const worker = async () => {
    while (next < items.length) {
      const i = next++;
      results[i] = await work(items[i]);
    }
  };
  await Promise.all(Array.from({ length: Math.min(jobs, items.length) }, worker));
  return results;
}

/** The paths under version control (and new ones that are not ignored), relative to the root, that match. */
export async function trackedFiles(pattern = /./) {
  const { status, output } = await run("git", [
    "ls-files",
    "-z",
    "--cached",
    "--others",
    "--exclude-standard",
    "--deduplicate",
  ]);
  if (status !== 0) throw new Error(`git ls-files failed:\n${output}`);
  return output
    .split("\0")
    .filter((path) => path !== "" && pattern.test(path))
    .filter((path) => contentOf(path) !== null)
    .sort();
}

const contents = new Map();
/** A file's text, or null where there is none (deleted but not yet committed). */
export function contentOf(path) {
  if (!contents.has(path)) {
    try {
      contents.set(path, readFileSync(resolve(root, path), "utf8"));
    } catch {
      contents.set(path, null);
    }
  }
  return contents.get(path);
}

/** The project's headers that a C++ file includes, directly or not, the file itself first. */
export function withProjectIncludes(path) {
  const seen = new Set();
  const visit = (current) => {
    const text = contentOf(current);
    if (seen.has(current) || text === null) return;
    seen.add(current);
    for (const [, included] of text.matchAll(/^\s*#\s*include\s+"([^"]+)"/gm)) visit(included);
  };
  visit(path);
  return [...seen];
}

/** A short name for everything that the parts say. */
export function digest(...parts) {
  const hash = createHash("sha256");
  for (const part of parts) hash.update(part).update("\0");
  return hash.digest("hex").slice(0, 32);
}

/** One gate's verdict as a lane result: a list of complaints, each naming file and reason. */
export function verdict(complaints, advice = "") {
  if (complaints.length === 0) return { passed: 1, failed: 0, output: "" };
  return {
    passed: 0,
    failed: 1,
    output: [...complaints.map((line) => `    ${line}`), advice && `    ${advice}`]
      .filter(Boolean)
      .join("\n"),
  };
}

/** Several verdicts as one lane. */
export function together(verdicts) {
  return {
    passed: verdicts.reduce((total, { passed }) => total + passed, 0),
    failed: verdicts.reduce((total, { failed }) => total + failed, 0),
    output: verdicts
      .map(({ output }) => output)
      .filter(Boolean)
      .join("\n"),
  };
}
