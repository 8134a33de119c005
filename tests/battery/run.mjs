// The reliability battery: a daemon of our own under hostile bytes, slow and vanishing clients, and load.
//
//   node tests/battery/run.mjs [--scale S] [--seed N] [hostile|tls|connections|load|durability …]
//
// S scales how much is sent: 1 is the full battery (about a quarter of an hour), 0.02 what `make test` runs. POINTWRIGHTD
// names another build's daemon, a sanitizer's say. Exit status: 0 where every check holds.
import { parseArgs } from "node:util";
import { connections } from "./connections.mjs";
import { durability } from "./durability.mjs";
import { hostile } from "./hostile.mjs";
import { load } from "./load.mjs";
import { tls } from "./tls.mjs";

const parts = { hostile, tls, connections, load, durability };
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { scale: { type: "string", default: "1" }, seed: { type: "string", default: "1" } },
});
const params = { scale: Number(values.scale), seed: Number(values.seed) };
const unknown = positionals.filter((name) => !(name in parts));
if (unknown.length > 0 || !(params.scale > 0) || !Number.isInteger(params.seed)) {
  console.error(
    `usage: node tests/battery/run.mjs [--scale S] [--seed N] [${Object.keys(parts).join("|")} ...]`,
  );
  process.exit(2);
}
let passed = 0;
let failed = 0;
for (const [name, part] of Object.entries(parts)) {
  if (positionals.length > 0 && !positionals.includes(name)) continue;
  const report = await part(params);
  passed += report.passed;
  failed += report.failed;
}
console.log(`\n${passed} checks passed, ${failed} failed`);
process.exitCode = failed > 0 ? 1 : 0;
