// The README's shell lines run as they stand there: the fenced block after the marker, against a daemon of our own.
// Only the address differs.
import { mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { startDaemon } from "../../web/demo/daemon.mjs";
import { contentOf, root, run, verdict } from "../support/process.mjs";

const marker = "<!-- checked: these lines run in the tests -->";

export async function readme() {
  const block = contentOf("README.md")
    ?.split(marker)[1]
    ?.match(/^\s*```sh\n([\s\S]*?)^```$/m)?.[1];
  if (!block) return verdict([`README.md has no fenced block of shell after '${marker}'`]);
  // A folder of its own that looks like the repository's root, so that what the lines write is not left behind.
  const folder = mkdtempSync(join(tmpdir(), "pointwright-readme-"));
  mkdirSync(join(folder, "build"));
  symlinkSync(resolve(root, "build/data"), join(folder, "build/data"));
  const daemon = await startDaemon();
  try {
    const script = block
      .replaceAll("http://127.0.0.1:8080", daemon.url)
      .replaceAll("http://localhost:8080", daemon.url);
    const { status, output } = await run(
      "bash",
      ["-euo", "pipefail", "-c", `curl() { command curl --fail-with-body "$@"; }\n${script}`],
      {
        cwd: folder,
        timeoutSeconds: 120,
      },
    );
    if (status === 0 && readFileSync(join(folder, "build/edited.ply")).subarray(0, 4).toString() !== "ply\n")
      return verdict(["README.md: build/edited.ply is no PLY file"]);
    return verdict(
      status === 0 ? [] : [`README.md: its lines ended with ${status}:\n${output}\n${daemon.log()}`],
    );
  } finally {
    await daemon.stop();
    rmSync(folder, { recursive: true, force: true });
  }
}
