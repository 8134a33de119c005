// Builds the typed client as a package: clients/typescript/dist, one module and its types.
import { spawnSync } from "node:child_process";
import { copyFileSync, mkdirSync, rmSync } from "node:fs";
import { dirname, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const web = resolve(dirname(fileURLToPath(import.meta.url)), "..");
const dist = resolve(web, "../clients/typescript/dist");

rmSync(dist, { recursive: true, force: true });
await build({
  entryPoints: [resolve(web, "src/api/index.ts")],
  outfile: resolve(dist, "pointwright.js"),
  bundle: true,
  format: "esm",
  platform: "neutral",
  target: "es2022",
  logLevel: "warning",
});
const tsc = resolve(web, "node_modules/typescript/bin/tsc");
const { status } = spawnSync(process.execPath, [tsc, "-p", resolve(web, "tsconfig.client.json")], {
  stdio: "inherit",
});
if (status !== 0) process.exit(1);
// The compiler leaves out what is a declaration already.
mkdirSync(resolve(dist, "types/protocol"), { recursive: true });
copyFileSync(resolve(web, "src/protocol/openapi.d.ts"), resolve(dist, "types/protocol/openapi.d.ts"));
