// The test runner: every lane in turn, going on after failures, then a table and the one line that counts.
//
//   node tests/run.mjs [LANE...]      all lanes, or only the named ones
//
// A lane is {name, about, run}; run() answers {passed, failed, output}: how many test cases passed and failed, and what to
// show when some failed. A gate counts as one test. Exit status: 0 only where something ran and nothing failed.
import { lanes } from "./lanes.mjs";

const wanted = process.argv.slice(2);
if (wanted.includes("--list")) {
  for (const { name, about } of lanes) console.log(`${name.padEnd(12)} ${about}`);
  process.exit(0);
}
const unknown = wanted.filter((name) => !lanes.some((lane) => lane.name === name));
if (unknown.length > 0) {
  console.error(`no such lane: ${unknown.join(", ")} (there are ${lanes.map((lane) => lane.name).join(", ")})`);
  process.exit(2);
}

const results = [];
for (const lane of lanes.filter(({ name }) => wanted.length === 0 || wanted.includes(name))) {
  console.log(`--- ${lane.name}: ${lane.about}`);
  const start = Date.now();
  let result;
  try {
    result = await lane.run();
  } catch (error) {
    result = { passed: 0, failed: 1, output: String(error?.stack ?? error) };
  }
  const seconds = (Date.now() - start) / 1000;
  if (result.failed > 0) console.log(result.output.trimEnd());
  console.log(`    ${result.failed > 0 ? "FAILED" : "ok"} in ${seconds.toFixed(1)} s`);
  results.push({ name: lane.name, seconds, ...result });
}

const row = (name, passed, failed, seconds) =>
  console.log(`${String(name).padEnd(12)} ${String(passed).padStart(7)} ${String(failed).padStart(7)} ${String(seconds).padStart(9)}`);
console.log();
row("lane", "passed", "failed", "seconds");
for (const { name, passed, failed, seconds } of results) row(name, passed, failed, seconds.toFixed(1));
const sum = (key) => results.reduce((total, result) => total + result[key], 0);
console.log(`\n${sum("passed")} passed, ${sum("failed")} failed`);
process.exitCode = sum("failed") > 0 || sum("passed") === 0 ? 1 : 0;
