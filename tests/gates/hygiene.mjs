// What the repository may not hold: names of registries, paths of somebody's machine, resolved addresses in lock files,
// big files, sources that have outgrown their kind.
import { statSync } from "node:fs";
import { resolve } from "node:path";
import { contentOf, root, together, trackedFiles, verdict } from "../support/process.mjs";

const isText = (path) => !contentOf(path).includes("\0");
const maxBytes = 1024 * 1024;

/** Lines that match, as complaints. The patterns below are written so that they do not match themselves. */
async function forbidden(pattern, reason, files = /./) {
  const complaints = [];
  for (const path of (await trackedFiles(files)).filter(isText)) {
    contentOf(path)
      .split("\n")
      .forEach((line, i) => {
        if (pattern.test(line)) complaints.push(`${path}:${i + 1}: ${reason}: ${line.trim().slice(0, 120)}`);
      });
  }
  return verdict(complaints);
}

async function bigFiles() {
  const complaints = [];
  for (const path of await trackedFiles()) {
    const { size } = statSync(resolve(root, path));
    if (size > maxBytes)
      complaints.push(`${path} has ${size} bytes; files above ${maxBytes} do not belong here`);
  }
  return verdict(complaints);
}

async function sizes() {
  const limits = [
    { files: /^(engine|protocol|server)\/.*\.h$/, lines: 200 },
    { files: /^(engine|protocol|server)\/.*\.cpp$/, lines: 600 },
    { files: /^tests\/.*\.(h|cpp|mjs)$/, lines: 900 },
    { files: /^web\/(src|scripts|demo)\/.*\.(ts|mjs)$/, lines: 450, except: /\.d\.ts$/ },
  ];
  const complaints = [];
  for (const { files, lines, except } of limits) {
    for (const path of await trackedFiles(files)) {
      const count = contentOf(path).split("\n").length - 1;
      if (count > lines && !except?.test(path))
        complaints.push(`${path} has ${count} lines, more than ${lines}: it holds more than one concept`);
    }
  }
  return verdict(complaints);
}

async function conflictMarks() {
  return forbidden(/^(<{7}|>{7}|={7})( |$)/, "a mark of an unfinished merge");
}

export async function hygiene() {
  return together([
    await forbidden(
      /registry\.[a-z0-9-]+\.[a-z]{2,}|\b(deb|security)\.debian[.]org|pypi[.]org|crates[.]io\b/,
      "a registry's host name",
    ),
    await forbidden(
      /(^|[\s"'`=(:,])\/(home|root|Users|work)\/[A-Za-z0-9._-]/,
      "a path of somebody's machine",
      /^(?!docker\/)/,
    ),
    await forbidden(/"resolved"\s*:/, "a resolved address", /(^|\/)package-lock\.json$/),
    await bigFiles(),
    await sizes(),
    await conflictMarks(),
  ]);
}
