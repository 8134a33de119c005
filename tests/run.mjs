// The test runner: every lane in turn, going on after failures, then a table and the one line that counts.
//
//   node tests/run.mjs [LANE...]      all lanes, or only the named ones
//
// A lane is {name, about, run}; run() answers {passed, failed, output}: how many test cases passed and failed, and what to
// show when some failed. A gate counts as one test. A lane that is `beside` takes what the processors have left while those
// after it run. Exit status: 0 only where something ran and nothing failed.
import { mkdirSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { lanes } from "./lanes.mjs";
import { root } from "./support/process.mjs";

const shownLines = 300;
const logs = resolve(root, "build/checks/logs");

/** Failing output, cut where it would bury the rest; the whole stands in its log. */
function show(output, log) {
  const lines = output.trimEnd().split("\n");
  if (lines.length <= shownLines) return console.log(lines.join("\n"));
  console.log(lines.slice(0, shownLines / 3).join("\n"));
  console.log(`    ... ${lines.length - shownLines} lines left out; all of them: ${log}`);
  console.log(lines.slice(-(2 * shownLines) / 3).join("\n"));
}

const wanted = process.argv.slice(2);
if (wanted.includes("--list")) {
  for (const { name, about } of lanes) console.log(`${name.padEnd(12)} ${about}`);
  process.exit(0);
}
const unknown = wanted.filter((name) => !lanes.some((lane) => lane.name === name));
if (unknown.length > 0) {
  console.error(
    `no such lane: ${unknown.join(", ")} (there are ${lanes.map((lane) => lane.name).join(", ")})`,
  );
  process.exit(2);
}

mkdirSync(logs, { recursive: true });
/** Runs a lane, shows what failed, and answers what it came to. */
async function runLane(lane) {
  const start = Date.now();
  let result;
  try {
    result = await lane.run();
  } catch (error) {
    result = { passed: 0, failed: 1, output: String(error?.stack ?? error) };
  }
  const seconds = (Date.now() - start) / 1000;
  const log = resolve(logs, `${lane.name}.log`);
  writeFileSync(log, result.output);
  if (result.failed > 0) show(result.output, log);
  const which = lane.beside ? `${lane.name} ` : "";
  console.log(`    ${which}${result.failed > 0 ? "FAILED" : "ok"} in ${seconds.toFixed(1)} s`);
  return { name: lane.name, seconds, ...result };
}

const running = [];
for (const lane of lanes.filter(({ name }) => wanted.length === 0 || wanted.includes(name))) {
  console.log(`--- ${lane.name}: ${lane.about}${lane.beside ? " (beside what follows)" : ""}`);
  const outcome = runLane(lane);
  if (!lane.beside) await outcome;
  running.push(outcome);
}
const results = await Promise.all(running);

const row = (name, passed, failed, seconds) =>
  console.log(
    `${String(name).padEnd(12)} ${String(passed).padStart(7)} ${String(failed).padStart(7)} ${String(seconds).padStart(9)}`,
  );
console.log();
row("lane", "passed", "failed", "seconds");
for (const { name, passed, failed, seconds } of results) row(name, passed, failed, seconds.toFixed(1));
const sum = (key) => results.reduce((total, result) => total + result[key], 0);
console.log(`\n${sum("passed")} passed, ${sum("failed")} failed`);
process.exitCode = sum("failed") > 0 || sum("passed") === 0 ? 1 : 0;
