/** Vectors as plain tuples: the tools, the edits and the HTTP documents all speak these; only scene/ knows three.js. */
export type Vec3 = readonly [number, number, number];

export const ZERO: Vec3 = [0, 0, 0];

export function add(a: Vec3, b: Vec3): Vec3 {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

export function subtract(a: Vec3, b: Vec3): Vec3 {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function scale(a: Vec3, factor: number): Vec3 {
  return [a[0] * factor, a[1] * factor, a[2] * factor];
}

export function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function length(a: Vec3): number {
  return Math.hypot(a[0], a[1], a[2]);
}

export function distance(a: Vec3, b: Vec3): number {
  return length(subtract(a, b));
}

/** The unit vector of `a`; `fallback` where `a` has no direction. */
export function normalise(a: Vec3, fallback: Vec3 = [0, 0, 1]): Vec3 {
  const size = length(a);
  return size > 0 && Number.isFinite(size) ? scale(a, 1 / size) : fallback;
}

export function isFiniteVec3(a: Vec3): boolean {
  return a.every((value) => Number.isFinite(value));
}

/** The distance of `point` from the segment a–b. */
export function distanceToSegment(point: Vec3, a: Vec3, b: Vec3): number {
  const along = subtract(b, a);
  const square = dot(along, along);
  const at = square > 0 ? Math.min(1, Math.max(0, dot(subtract(point, a), along) / square)) : 0;
  return distance(point, add(a, scale(along, at)));
}
