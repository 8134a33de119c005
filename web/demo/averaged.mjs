// What resampling looks like where colours are averaged over the deformed samples, for comparison.
import { openPly, readPly } from "./ply.mjs";

/** Cells of a grid, side `width`, by the samples that stand in them. */
function grid(positions, count, width) {
  const cells = new Map();
  const key = (x, y, z) => `${Math.floor(x / width)} ${Math.floor(y / width)} ${Math.floor(z / width)}`;
  for (let i = 0; i < count; i++) {
    const at = key(...positions.subarray(3 * i, 3 * i + 3));
    if (!cells.has(at)) cells.set(at, []);
    cells.get(at).push(i);
  }
  return (x, y, z, rings) => {
    const found = [];
    for (let dx = -rings; dx <= rings; dx++)
      for (let dy = -rings; dy <= rings; dy++)
        for (let dz = -rings; dz <= rings; dz++)
          found.push(...(cells.get(key(x + dx * width, y + dy * width, z + dz * width)) ?? []));
    return found;
  };
}

/**
 * The binary PLY file with every vertex from `originals` on coloured by a Gaussian average of the `k` nearest of the
 * vertices before it, where they stand now: what interpolating among deformed samples gives.
 */
export function averaged(bytes, originals, k) {
  const result = bytes.slice();
  const { count, stride, columns, view } = openPly(result);
  const { positions } = readPly(result);
  const near = grid(positions, originals, 0.05);
  const channels = ["red", "green", "blue"].map((name) => columns.get(name).offset);
  for (let i = originals; i < count; i++) {
    const here = positions.subarray(3 * i, 3 * i + 3);
    const away = (j) => Math.hypot(...[0, 1, 2].map((axis) => positions[3 * j + axis] - here[axis]));
    let candidates = [];
    for (let rings = 1; candidates.length < k; rings++) candidates = near(...here, rings);
    const nearest = candidates.map((j) => [away(j), j]).sort((a, b) => a[0] - b[0]);
    nearest.length = k;
    const reach = nearest[k - 1][0];
    const weights = nearest.map(([distance]) => Math.exp(-4 * (distance / reach) ** 2));
    const total = weights.reduce((sum, weight) => sum + weight, 0);
    for (const offset of channels) {
      const sum = nearest.reduce((s, [, j], n) => s + weights[n] * view.getUint8(j * stride + offset), 0);
      view.setUint8(i * stride + offset, Math.round(sum / total));
    }
  }
  return result;
}
