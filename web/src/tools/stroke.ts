import type { RegionOperation } from "../api/types";
import { distance, distanceToSegment, type Vec3 } from "../math/vec3";

/** Of the radius: what a stroke may be simplified by. */
const TOLERANCE = 0.06;

/**
 * The vertices of a stroke without those that lie within `tolerance` of the line through the rest (Douglas and Peucker).
 * Both ends stay. Iterative, so a long stroke needs no deep stack.
 */
export function simplifyStroke(vertices: readonly Vec3[], tolerance: number): Vec3[] {
  const count = vertices.length;
  if (count <= 2) return [...vertices];
  const keep = new Uint8Array(count);
  keep[0] = 1;
  keep[count - 1] = 1;
  const open: [number, number][] = [[0, count - 1]];
  for (let range = open.pop(); range; range = open.pop()) {
    const [first, last] = range;
    const a = vertices[first];
    const b = vertices[last];
    if (!a || !b) continue;
    let farthest = -1;
    let most = tolerance;
    for (let i = first + 1; i < last; ++i) {
      const vertex = vertices[i];
      const away = vertex ? distanceToSegment(vertex, a, b) : 0;
      if (away > most) {
        most = away;
        farthest = i;
      }
    }
    if (farthest >= 0) {
      keep[farthest] = 1;
      open.push([first, farthest], [farthest, last]);
    }
  }
  return vertices.filter((_, i) => keep[i] === 1);
}

/** Whether a stroke that went from `from` to `to` jumped across a gap in depth, and so begins anew at `to`. */
export function isDepthJump(
  from: Vec3,
  to: Vec3,
  depthFrom: number,
  depthTo: number,
  radius: number,
): boolean {
  return Math.abs(depthFrom - depthTo) > 1.5 * radius && distance(from, to) > 2 * radius;
}

/** Whether `to` is far enough from the last vertex to be worth one. */
export function isNewVertex(last: Vec3 | undefined, to: Vec3, radius: number): boolean {
  return !last || distance(last, to) >= 0.15 * radius;
}

export const BRUSH_STEP = 1.15;

/** A brush radius after `steps` presses of a key or notches of a wheel, within sensible parts of the object. */
export function steppedRadius(radius: number, steps: number, diagonal: number): number {
  return Math.min(0.5 * diagonal, Math.max(5e-4 * diagonal, radius * BRUSH_STEP ** steps));
}

/** A part of a stroke as the server takes it; a single touch is a sphere. */
export function strokeOperation(
  vertices: readonly Vec3[],
  radius: number,
  facing: Vec3,
  erase: boolean,
): RegionOperation {
  const simple = simplifyStroke(vertices, TOLERANCE * radius);
  const [first] = simple;
  const shape =
    simple.length === 1 && first
      ? ({ type: "sphere", center: first, radius } as const)
      : ({ type: "stroke", vertices: simple, radius } as const);
  return erase ? { mode: "remove", shape, facing } : { mode: "add", shape, facing, steal: true };
}
