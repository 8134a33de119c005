// The lanes of the test runner, in the order in which they run: quick ones first, then what needs the build. Tests wait for
// each other more than they compute, so clang-tidy runs beside them.
import { existsSync, mkdirSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { basename, resolve } from "node:path";
import { dependencies } from "./gates/dependencies.mjs";
import { format } from "./gates/format.mjs";
import { headers } from "./gates/headers.mjs";
import { hygiene } from "./gates/hygiene.mjs";
import { readme } from "./gates/readme.mjs";
import { tidy } from "./gates/tidy.mjs";
import { jobs, root, run, together, trackedFiles, verdict } from "./support/process.mjs";

const web = resolve(root, "web");
const release = resolve(root, "build/release");

/** A make target as one test. */
async function make(...targets) {
  const { status, output } = await run("make", ["--no-print-directory", ...targets]);
  return verdict(status === 0 ? [] : [output.trim()]);
}

/** Every doctest case and every other ctest entry. A binary that ends badly without saying which case failed counts as one failure. */
async function cpp() {
  const junit = resolve(release, "junit");
  rmSync(junit, { recursive: true, force: true });
  mkdirSync(junit, { recursive: true });
  const summary = resolve(release, "ctest.xml");
  rmSync(summary, { force: true });
  const { status, output } = await run(
    "ctest",
    ["--preset", "release", "--timeout", "900", "-j", String(jobs), "--output-junit", summary],
    {
      timeoutSeconds: 3600,
    },
  );
  if (!existsSync(summary)) return { passed: 0, failed: 1, output };
  let passed = 0;
  let failed = 0;
  const reports = new Map(
    readdirSync(junit).map((file) => [basename(file, ".xml"), readFileSync(resolve(junit, file), "utf8")]),
  );
  for (const [, name, outcome] of readFileSync(summary, "utf8").matchAll(
    /<testcase name="([^"]+)"[^>]*status="([^"]+)"/g,
  )) {
    if (outcome === "disabled" || outcome === "notrun") continue;
    const report = reports.get(name);
    const cases = report ? report.split("<testcase").slice(1) : [];
    const bad = cases.filter((text) => /<(failure|error)\b/.test(text)).length;
    const ended = outcome !== "fail" || bad > 0;
    passed += cases.length > 0 ? cases.length - bad : ended ? 1 : 0;
    failed += bad + (ended ? 0 : 1);
  }
  if (status !== 0 && failed === 0) failed = 1;
  return { passed, failed, output };
}

async function webUnit() {
  const report = resolve(root, "build/vitest.json");
  rmSync(report, { force: true });
  const { output } = await run(
    "node",
    [
      "node_modules/vitest/vitest.mjs",
      "run",
      "--reporter=default",
      "--reporter=json",
      `--outputFile.json=${report}`,
    ],
    { cwd: web },
  );
  if (!existsSync(report)) return { passed: 0, failed: 1, output };
  const { numPassedTests, numFailedTests, success } = JSON.parse(readFileSync(report, "utf8"));
  return { passed: numPassedTests, failed: success ? 0 : Math.max(1, numFailedTests), output };
}

async function nodeTests(pattern, folder) {
  const files = await trackedFiles(pattern);
  if (files.length === 0) return { passed: 0, failed: 1, output: `    ${folder} holds no *.test.mjs` };
  const { status, output } = await run("node", ["--test", "--test-reporter=tap", ...files], {
    timeoutSeconds: 900,
  });
  const total = (what) => Number(output.match(new RegExp(`^# ${what} (\\d+)$`, "m"))?.[1] ?? 0);
  const failed = total("fail") + total("cancelled");
  return { passed: total("pass"), failed: status !== 0 && failed === 0 ? 1 : failed, output };
}

/** The reliability battery at a fiftieth of its length; each check is a test. */
async function battery() {
  const { status, output } = await run("node", ["tests/battery/run.mjs", "--scale", "0.02"], {
    timeoutSeconds: 600,
  });
  const [, passed, failed] = output.match(/^(\d+) checks passed, (\d+) failed$/m) ?? [null, 0, 1];
  return { passed: Number(passed), failed: Math.max(Number(failed), status === 0 ? 0 : 1), output };
}

/** The clients against daemons of their own: Python and the command line (Debian's Python), what pyflakes and mypy find; TypeScript. */
async function clients() {
  const python = process.env.PYTHON ?? "/usr/bin/python3";
  const checks = await Promise.all([
    run(python, ["-m", "pyflakes", "clients/python", "tests/clients"]),
    run(python, [
      "-m",
      "mypy",
      "--no-incremental",
      "--python-version",
      "3.9",
      "clients/python/pointwright.py",
    ]),
  ]);
  const found = together(checks.map(({ status, output }) => verdict(status === 0 ? [] : [output.trim()])));
  const { status, output } = await run(python, ["-m", "unittest", "discover", "-s", "tests/clients"], {
    timeoutSeconds: 900,
    env: { PYTHONDONTWRITEBYTECODE: "1" },
  });
  const total = Number(output.match(/^Ran (\d+) tests? in/m)?.[1] ?? 0);
  const count = (what) => Number(output.match(new RegExp(`\\b${what}=(\\d+)`))?.[1] ?? 0);
  const bad = count("failures") + count("errors");
  const failed = status !== 0 && bad === 0 ? 1 : bad;
  const tests = { passed: Math.max(0, total - failed), failed, output };
  const typescript = await nodeTests(/^tests\/clients\/.*\.test\.mjs$/, "tests/clients");
  return together([found, tests, typescript]);
}

export const lanes = [
  { name: "format", about: "clang-format, Biome, shell syntax", run: format },
  { name: "layers", about: "the direction of dependencies", run: dependencies },
  { name: "hygiene", about: "no machine's paths, registries, big files", run: hygiene },
  { name: "build", about: "everything in C++, warnings are errors", run: () => make("build-tests") },
  { name: "viewer", about: "the viewer's types and its build", run: () => make("viewer") },
  { name: "headers", about: "every header compiles alone", run: headers },
  { name: "tidy", about: "clang-tidy", run: tidy, beside: true },
  { name: "cpp", about: "the C++ tests", run: cpp },
  { name: "web", about: "the viewer's unit tests", run: webUnit },
  { name: "clients", about: "clients: Python, command line, TypeScript", run: clients },
  { name: "sample", about: "the Stanford dragon is converted", run: () => make("sample") },
  { name: "readme", about: "the README's shell lines run", run: readme },
  {
    name: "browser",
    about: "the viewer in a real browser",
    run: () => nodeTests(/^tests\/web\/.*\.test\.(mjs|js)$/, "tests/web"),
  },
  { name: "battery", about: "hostile bytes, slow clients and load, in short", run: battery },
];
