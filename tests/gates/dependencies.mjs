// The direction of dependencies: web -> protocol <- server, server -> protocol -> engine, and inside the engine the order
// of its folders.
import { contentOf, together, trackedFiles, verdict } from "../support/process.mjs";

const engineOrder = [
  "core",
  "spatial",
  "normals",
  "simplification",
  "smoothing",
  "multires",
  "editing",
  "resampling",
  "transfer",
  "io",
]; // prettier-ignore

/** Libraries, and where alone each may be included. What is not listed here (the standard library, Eigen) may be anywhere. */
const fenced = [
  { name: "cpp-httplib", header: /^httplib\.h$/, allowed: /^(server\/http|tests)\// },
  { name: "nlohmann-json", header: /^nlohmann\//, allowed: /^(protocol|server|tests)\// },
  { name: "spdlog and fmt", header: /^(spdlog|fmt)\//, allowed: /^(server|tests)\// },
  { name: "toml++", header: /^toml(plusplus|\+\+)/, allowed: /^(server|tests)\// },
  { name: "CLI11", header: /^CLI\//, allowed: /^(server|tests)\// },
  { name: "libseccomp", header: /^seccomp\.h$/, allowed: /^(server|tests)\// },
  { name: "libpng", header: /^png\.h$/, allowed: /^(server\/ingest|tests)\// },
  { name: "SQLite", header: /^sqlite3\.h$/, allowed: /^(server\/store|tests\/server)/ },
  { name: "OpenSSL", header: /^openssl\//, allowed: /^(server|tests)\// },
  { name: "sockets", header: /^(sys\/socket|netinet\/.*|arpa\/.*|netdb)\.h$/, allowed: /^(server|tests)\// },
  { name: "Draco", header: /^draco\//, allowed: /^(engine\/io|tests)\// },
  { name: "libarchive", header: /^archive(_entry)?\.h$/, allowed: /^engine\/io\// },
  { name: "nanoflann", header: /^nanoflann/, allowed: /^(engine\/spatial|tests)\// },
  { name: "TBB", header: /^(oneapi|tbb)\//, allowed: /^(engine\/core\/worker_threads|tests\/)/ },
  {
    name: "threads",
    header: /^(thread|future|execution)$/,
    allowed: /^(engine\/core\/worker_threads|server\/|tests\/)/,
  },
  { name: "a peer", header: /^(CGAL|pcl|open3d|omp\.h)/, allowed: /^tests\/bench\/peers\/peer_/ },
  { name: "doctest", header: /^doctest\//, allowed: /^tests\// },
];
/** Which top folder may include which. */
const layers = {
  engine: ["engine"],
  protocol: ["engine", "protocol"],
  server: ["engine", "protocol", "server"],
  tests: ["engine", "protocol", "server", "tests"],
};

function complainAboutInclude(path, included, files) {
  const [layer, folder] = path.split("/");
  const [targetLayer, targetFolder] = included.split("/");
  if (!files.has(included)) {
    return "names no file of this repository: quoted includes name a path from the root";
  }
  if (!layers[layer].includes(targetLayer)) return `${layer}/ may not include ${targetLayer}/`;
  if (layer === "engine" && folder !== targetFolder) {
    const [from, to] = [engineOrder.indexOf(folder), engineOrder.indexOf(targetFolder)];
    if (from === -1 || to === -1)
      return `engine/${from === -1 ? folder : targetFolder} has no place in the engine's order`;
    if (to > from) return `engine/${folder} comes before engine/${targetFolder} and may not include it`;
  }
  if (layer === "tests" && folder === "engine" && targetLayer === "server")
    return "the engine's tests know nothing of the server";
  return null;
}

async function cppIncludes() {
  const paths = await trackedFiles(/^(engine|protocol|server|tests)\/.*\.(h|cpp)$/);
  const files = new Set(paths);
  const complaints = [];
  for (const path of paths) {
    contentOf(path)
      .split("\n")
      .forEach((line, i) => {
        const match = line.match(/^\s*#\s*include\s+(?:"([^"]+)"|<([^>]+)>)/);
        if (!match) return;
        const [, own, system] = match;
        if (own) {
          const reason = complainAboutInclude(path, own, files);
          if (reason) complaints.push(`${path}:${i + 1}: "${own}" ${reason}`);
        } else {
          for (const { name, header, allowed } of fenced) {
            if (header.test(system) && !allowed.test(path))
              complaints.push(`${path}:${i + 1}: <${system}>: ${name} may not be used here`);
          }
        }
      });
  }
  return verdict(
    complaints,
    "The order is engine/core, …, engine/io, then protocol, then server (tests/gates/dependencies.mjs).",
  );
}

/** The viewer speaks the protocol only: its sources import one another, three.js and nothing else. */
async function webImports() {
  const complaints = [];
  for (const path of await trackedFiles(/^web\/src\/.*\.(ts|mjs|js)$/)) {
    for (const [, name] of contentOf(path).matchAll(/(?:from\s+|import\s*\(?\s*)["']([^"']+)["']/g)) {
      if (name.startsWith(".")) {
        const target = new URL(name, `file:///${path}`).pathname.slice(1);
        if (!target.startsWith("web/")) complaints.push(`${path}: imports ${name}, outside of web/`);
      } else if (!/^three(\/|$)/.test(name)) {
        complaints.push(`${path}: imports ${name}; the viewer ships three.js alone`);
      }
    }
  }
  return verdict(complaints);
}

export async function dependencies() {
  return together([await cppIncludes(), await webImports()]);
}
