import { readFileSync } from "node:fs";
import { gunzipSync } from "node:zlib";

/** Samples of a surface: positions and unit normals, three numbers each, and the signed detail. */
export interface MockShape {
  count: number;
  positions: Float32Array;
  normals: Float32Array;
  detail: Float32Array;
}

/** A sphere with bumps: sunflower points, so neighbours in space are not neighbours in the array. */
export function bumpySphere(count: number): MockShape {
  const positions = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  const detail = new Float32Array(count);
  const radius = (x: number, y: number, z: number): number =>
    1 + 0.05 * Math.sin(9 * x) * Math.sin(8 * y) * Math.sin(7 * z);
  const golden = Math.PI * (3 - Math.sqrt(5));
  for (let i = 0; i < count; ++i) {
    const z = 1 - (2 * (i + 0.5)) / count;
    const ring = Math.sqrt(1 - z * z);
    const x = ring * Math.cos(golden * i);
    const y = ring * Math.sin(golden * i);
    const r = radius(x, y, z);
    positions.set([x * r, y * r, z * r], 3 * i);
    const h = 1e-3;
    const gradient = [
      (radius(x + h, y, z) - r) / h,
      (radius(x, y + h, z) - r) / h,
      (radius(x, y, z + h) - r) / h,
    ] as const;
    const n = [x * r - gradient[0], y * r - gradient[1], z * r - gradient[2]] as const;
    const length = Math.hypot(...n);
    normals.set([n[0] / length, n[1] / length, n[2] / length], 3 * i);
    detail[i] = r - 1;
  }
  return { count, positions, normals, detail };
}

/** The vertices of an ASCII PLY mesh, gzipped or not, with normals averaged over its faces. */
export function plyVertices(path: string): MockShape {
  const raw = readFileSync(path);
  const lines = (raw[0] === 0x1f ? gunzipSync(raw) : raw).toString("latin1").split("\n");
  const start = lines.findIndex((line) => line.trim() === "end_header") + 1;
  const element = (name: string): number =>
    Number(lines.find((line) => line.startsWith(`element ${name} `))?.split(" ")[2] ?? 0);
  const count = element("vertex");
  const positions = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const [x, y, z] = (lines[start + i] ?? "").split(" ").map(Number);
    positions.set([x ?? 0, y ?? 0, z ?? 0], 3 * i);
  }
  for (let face = 0; face < element("face"); ++face) {
    const [, a, b, c] = (lines[start + count + face] ?? "").trim().split(/\s+/).map(Number);
    const at = (v: number | undefined, axis: number): number => positions[3 * (v ?? 0) + axis] ?? 0;
    const e = [0, 1, 2].map((axis) => at(b, axis) - at(a, axis));
    const f = [0, 1, 2].map((axis) => at(c, axis) - at(a, axis));
    const cross = [0, 1, 2].map(
      (axis) =>
        (e[(axis + 1) % 3] ?? 0) * (f[(axis + 2) % 3] ?? 0) -
        (e[(axis + 2) % 3] ?? 0) * (f[(axis + 1) % 3] ?? 0),
    );
    for (const v of [a, b, c])
      for (let axis = 0; axis < 3; ++axis)
        normals[3 * (v ?? 0) + axis] = (normals[3 * (v ?? 0) + axis] ?? 0) + (cross[axis] ?? 0);
  }
  for (let i = 0; i < count; ++i) {
    const length = Math.hypot(normals[3 * i] ?? 0, normals[3 * i + 1] ?? 0, normals[3 * i + 2] ?? 0) || 1;
    for (let axis = 0; axis < 3; ++axis) normals[3 * i + axis] = (normals[3 * i + axis] ?? 0) / length;
  }
  return { count, positions, normals, detail: new Float32Array(count) };
}
