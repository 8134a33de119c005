// Every fuzzing target in turn, as many at once as there are processors, from the corpus on. What is found stays in
// build/found/<target>; nothing found is exit status 0.
//
//   node tests/fuzz/run.mjs [--seconds 600] [TARGET...]
import { existsSync, mkdirSync, readdirSync } from "node:fs";
import { resolve } from "node:path";
import { inParallel, root, run } from "../support/process.mjs";

const args = process.argv.slice(2);
const at = args.indexOf("--seconds");
const [, given] = at < 0 ? [] : args.splice(at, 2);
const seconds = Number(given ?? 600);
if (!(seconds > 0)) {
  console.error("--seconds takes a number above 0");
  process.exit(2);
}
const programs = resolve(root, "build/fuzz/tests/fuzz");
const corpus = resolve(root, "tests/fuzz/corpus");
const all = readdirSync(corpus).filter((name) => existsSync(resolve(programs, `fuzz_${name}`)));
const unknown = args.filter((name) => !all.includes(name));
if (unknown.length > 0 || all.length === 0) {
  console.error(`no such target: ${unknown.join(", ")} (built: ${all.join(", ")})`);
  process.exit(2);
}

/** Bytes of the longest input, by what the formats need to say something. */
const longest = { draco: 16384, las: 16384, png: 16384, cloud_blob: 16384 };
/** Further inputs to start from. */
const seeds = { json: [resolve(root, "protocol/examples")], stream: [resolve(root, "protocol/vectors")] };
const outcomes = await inParallel(args.length > 0 ? args : all, async (target) => {
  const found = resolve(root, "build/found", target);
  mkdirSync(resolve(found, "inputs"), { recursive: true });
  const { status, output } = await run(
    resolve(programs, `fuzz_${target}`),
    [
      `-max_total_time=${seconds}`,
      `-max_len=${longest[target] ?? 8192}`,
      "-rss_limit_mb=3072",
      "-timeout=30",
      "-print_final_stats=1",
      `-artifact_prefix=${found}/`,
      resolve(found, "inputs"),
      resolve(corpus, target),
      ...(seeds[target] ?? []),
    ],
    { timeoutSeconds: seconds + 300 },
  );
  const runs = Number(output.match(/number_of_executed_units:\s*(\d+)/)?.[1] ?? 0);
  const covered = output.match(/cov: (\d+)/g)?.at(-1) ?? "";
  const good = status === 0 && runs > 0;
  console.log(`${target.padEnd(12)} ${good ? "nothing found" : "FOUND"}  ${runs} runs  ${covered}`);
  if (!good) console.log(output.split("\n").slice(-40).join("\n"));
  return good;
});
process.exitCode = outcomes.every(Boolean) ? 0 : 1;
