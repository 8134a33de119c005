import type { Vec3 } from "./vec3";

const RADIANS = Math.PI / 180;

/** Sine and cosine of degrees; quarter turns are exact. */
function sineCosine(degrees: number): [number, number] {
  const quarter = degrees / 90;
  if (Number.isInteger(quarter)) {
    const k = ((quarter % 4) + 4) % 4;
    return [[0, 1, 0, -1][k] ?? 0, [1, 0, -1, 0][k] ?? 1];
  }
  return [Math.sin(degrees * RADIANS), Math.cos(degrees * RADIANS)];
}

/** Scales by `size`, turns about x, then y, then z, and moves: row after row. */
export function placement(move: Vec3, turnDeg: Vec3, size: number): number[] {
  const [sx, cx] = sineCosine(turnDeg[0]);
  const [sy, cy] = sineCosine(turnDeg[1]);
  const [sz, cz] = sineCosine(turnDeg[2]);
  const rows = [
    [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx, move[0]],
    [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx, move[1]],
    [-sy, cy * sx, cy * cx, move[2]],
  ];
  // Adding nothing makes a negative zero a plain one.
  const linear = rows.flatMap(([a = 0, b = 0, c = 0, d = 0]) => [
    a * size + 0,
    b * size + 0,
    c * size + 0,
    d,
  ]);
  return [...linear, 0, 0, 0, 1];
}
