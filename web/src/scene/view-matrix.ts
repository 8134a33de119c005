import type { Vec2 } from "../api/types";
import type { Vec3 } from "../math/vec3";

export interface ScreenSize {
  width: number;
  height: number;
}

/**
 * Where a pixel of the picture (from its upper left corner) lies in the square view: the longer side of the picture spans
 * -1 … 1, and both axes have one unit, so that a line there is as wide as it looks.
 */
export function toSquare([x, y]: Vec2, { width, height }: ScreenSize): Vec2 {
  const unit = 2 / Math.max(width, height, 1);
  return [(x - width / 2) * unit, (height / 2 - y) * unit];
}

/**
 * Model to the clip space of the square view, row after row. `projection` and `view` as three.js keeps them, column after
 * column, for points less `origin`.
 */
export function squareView(
  projection: readonly number[],
  view: readonly number[],
  origin: Vec3,
  { width, height }: ScreenSize,
): number[] {
  const longer = Math.max(width, height, 1);
  const shrink = [width / longer, height / longer, 1, 1];
  const rows: number[] = [];
  for (let row = 0; row < 4; ++row) {
    const entries = [0, 1, 2, 3].map((column) => {
      let sum = 0;
      for (let k = 0; k < 4; ++k) sum += (projection[4 * k + row] ?? 0) * (view[4 * column + k] ?? 0);
      return sum * (shrink[row] ?? 1);
    });
    const [x = 0, y = 0, z = 0, w = 0] = entries;
    rows.push(x, y, z, w - (x * origin[0] + y * origin[1] + z * origin[2]));
  }
  return rows;
}

/** A rectangle of pixels in the plane through `focus` that faces the camera. */
export interface PlaneRectangle {
  /** The lower left corner. */
  origin: Vec3;
  /** The whole width, to the right. */
  u: Vec3;
  /** The whole height, upwards. */
  v: Vec3;
}

/** The axes of a camera, unit, and what a pixel spans at the focus. */
export interface FocusPlane {
  focus: Vec3;
  /** Where the focus is in the picture, pixels from the upper left corner. */
  focusPixel: Vec2;
  right: Vec3;
  up: Vec3;
  perPixel: number;
}

/** Turns a rectangle on the screen, in pixels, into one in space at the depth of the focus. */
export function placeRectangle(
  plane: FocusPlane,
  corner: Vec2,
  { width, height }: ScreenSize,
): PlaneRectangle {
  const { focus, focusPixel, right, up, perPixel } = plane;
  const x = (corner[0] - focusPixel[0]) * perPixel;
  const y = (focusPixel[1] - (corner[1] + height)) * perPixel;
  const at = (k: 0 | 1 | 2): number => focus[k] + x * right[k] + y * up[k];
  const along = (axis: Vec3, size: number): Vec3 => [axis[0] * size, axis[1] * size, axis[2] * size];
  return {
    origin: [at(0), at(1), at(2)],
    u: along(right, width * perPixel),
    v: along(up, height * perPixel),
  };
}
