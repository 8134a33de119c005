import { add, cross, distance, normalise, scale, subtract, type Vec3 } from "../math/vec3";

/** A camera in scene coordinates: model space less the session's origin. */
export interface CameraState {
  position: Vec3;
  target: Vec3;
  up: Vec3;
}

export const FIELD_OF_VIEW_DEG = 32;

export type ViewName = "front" | "back" | "left" | "right" | "top" | "bottom";

interface ViewAxes {
  direction: Vec3;
  up: Vec3;
}

/** From where each view looks at the target (y is up). */
export const VIEWS: Record<ViewName, ViewAxes> = {
  front: { direction: [0, 0, 1], up: [0, 1, 0] },
  back: { direction: [0, 0, -1], up: [0, 1, 0] },
  left: { direction: [-1, 0, 0], up: [0, 1, 0] },
  right: { direction: [1, 0, 0], up: [0, 1, 0] },
  top: { direction: [0, 1, 0], up: [0, 0, -1] },
  bottom: { direction: [0, -1, 0], up: [0, 0, 1] },
};

export const VIEW_NAMES: readonly ViewName[] = ["front", "back", "left", "right", "top", "bottom"];

/**
 * How far a camera stands off so that a sphere fits the narrower side of the picture. By default a little closer: what a
 * bounding sphere holds hardly ever reaches its rim.
 */
export function framingDistance(
  radius: number,
  aspect: number,
  fovDeg = FIELD_OF_VIEW_DEG,
  margin = 0.96,
): number {
  const half = (fovDeg * Math.PI) / 360;
  const narrow = aspect < 1 ? Math.atan(Math.tan(half) * aspect) : half;
  return (radius * margin) / Math.sin(narrow);
}

/** The camera that sees a sphere whole from `direction`. */
export function frameSphere(
  center: Vec3,
  radius: number,
  aspect: number,
  direction: Vec3,
  up: Vec3,
): CameraState {
  const away = framingDistance(Math.max(radius, 1e-12), aspect);
  return { position: add(center, scale(normalise(direction), away)), target: center, up };
}

/** Near and far planes that hold a sphere and give the depth buffer no more than it needs. */
export function clipPlanes(position: Vec3, center: Vec3, radius: number): { near: number; far: number } {
  const size = Math.max(radius, 1e-12);
  const away = distance(position, center);
  const near = Math.max(away - 1.6 * size, size * 2e-3);
  return { near, far: Math.max(away + 1.6 * size, near * 2) };
}

/** World units that one pixel spans at `depth`. */
export function worldPerPixel(depth: number, heightPixels: number, fovDeg = FIELD_OF_VIEW_DEG): number {
  return (2 * depth * Math.tan((fovDeg * Math.PI) / 360)) / Math.max(1, heightPixels);
}

const DIGITS = 6;

/** A camera as the URL's hash carries it: position, target, up; what is tiny beside the view is nothing. */
export function encodeCamera(camera: CameraState): string {
  const size = Math.max(...camera.position.map(Math.abs), ...camera.target.map(Math.abs), Number.MIN_VALUE);
  const encode = (vector: Vec3, unit: number): string =>
    vector
      .map((value) => String(Math.abs(value) < unit * 10 ** -DIGITS ? 0 : Number(value.toPrecision(DIGITS))))
      .join(",");
  return [encode(camera.position, size), encode(camera.target, size), encode(camera.up, 1)].join(";");
}

/** The camera of a hash value; null where it is not nine finite numbers that make a camera. */
export function decodeCamera(text: string): CameraState | null {
  const vectors = text
    .split(";")
    .map((part) => part.split(",").map((number) => (number.trim() === "" ? Number.NaN : Number(number))));
  if (
    vectors.length !== 3 ||
    vectors.some((v) => v.length !== 3 || v.some((value) => !Number.isFinite(value)))
  )
    return null;
  const [position, target, up] = vectors as unknown as [Vec3, Vec3, Vec3];
  const towards = subtract(target, position);
  const side = cross(towards, up);
  if (Math.hypot(...towards) === 0 || Math.hypot(...side) === 0) return null;
  return { position, target, up: normalise(up) };
}
