import type { Outline, Vec2 } from "../api/types";
import type { Vec3 } from "../math/vec3";
import { type ScreenSize, toSquare } from "../scene/view-matrix";
import { simplifyStroke } from "./stroke";

/** The server's limit. */
export const MAX_OUTLINE_VERTICES = 10_000;
/** What a hand-drawn outline may be simplified by. */
const TOLERANCE_PX = 0.5;
/** A gesture that stays within so many pixels is a slip of the hand. */
const LEAST_PX = 3;

/** A drawn curve without the vertices that do not show; coarser where it would exceed the server's limit. */
export function simplifyCurve(points: readonly Vec2[], most = MAX_OUTLINE_VERTICES): Vec2[] {
  const lifted = points.map(([x, y]): Vec3 => [x, y, 0]);
  for (let tolerance = TOLERANCE_PX; ; tolerance *= 2) {
    const kept = simplifyStroke(lifted, tolerance);
    if (kept.length <= most) return kept.map(([x, y]): Vec2 => [x, y]);
  }
}

/** The width and height of what holds the points. */
export function extentOf(points: readonly Vec2[]): ScreenSize {
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => y);
  if (points.length === 0) return { width: 0, height: 0 };
  const span = (values: number[]): number =>
    values.reduce((a, b) => Math.max(a, b)) - values.reduce((a, b) => Math.min(a, b));
  return { width: span(xs), height: span(ys) };
}

/** The corners of the rectangle that two opposite ones span, in order around it. */
export function rectangleCorners(a: Vec2, b: Vec2): Vec2[] {
  return [a, [b[0], a[1]], b, [a[0], b[1]]];
}

/** A lasso, polygon or rectangle as the server takes it; null where it encloses nothing. */
export function polygonOutline(points: readonly Vec2[], size: ScreenSize): Outline | null {
  const { width, height } = extentOf(points);
  if (width < LEAST_PX || height < LEAST_PX) return null;
  const kept = simplifyCurve(points);
  if (kept.length < 3) return null;
  return { type: "polygon", vertices: kept.map((point) => toSquare(point, size)) };
}

/** The centre and half axes of the ellipse in the rectangle that two opposite corners span. */
export function ellipseWithin(a: Vec2, b: Vec2): { center: Vec2; halfAxes: Vec2 } {
  return {
    center: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2],
    halfAxes: [Math.abs(b[0] - a[0]) / 2, Math.abs(b[1] - a[1]) / 2],
  };
}

export function ellipseOutline(a: Vec2, b: Vec2, size: ScreenSize): Outline | null {
  const { center, halfAxes } = ellipseWithin(a, b);
  if (2 * halfAxes[0] < LEAST_PX || 2 * halfAxes[1] < LEAST_PX) return null;
  const unit = 2 / Math.max(size.width, size.height, 1);
  return {
    type: "ellipse",
    center: toSquare(center, size),
    half_axes: [halfAxes[0] * unit, halfAxes[1] * unit],
  };
}

/** Everything within half of `width` pixels of a line. */
export function lineOutline(points: readonly Vec2[], width: number, size: ScreenSize): Outline | null {
  if (points.length === 0 || !(width > 0)) return null;
  return {
    type: "polyline",
    vertices: simplifyCurve(points).map((point) => toSquare(point, size)),
    width: (2 * width) / Math.max(size.width, size.height, 1),
  };
}
