import type { Deformation } from "../api/types";
import { distance, dot, length, normalise, subtract, type Vec3 } from "../math/vec3";
import { isIdentity } from "./deformation";

/**
 * What the picture adds to the server's last frame, as closed forms of a sample's position, normal and t: what the vertex
 * shader evaluates.
 */
export type Residual =
  | { kind: "translation"; vector: Vec3 }
  | { kind: "rotation"; point: Vec3; direction: Vec3; angleDeg: number }
  /** Undoes the factors `from` and makes `to`, each blended by t. */
  | { kind: "scale"; point: Vec3; from: Vec3; to: Vec3 }
  /** Turns by t times the height over the point. */
  | { kind: "twist"; point: Vec3; direction: Vec3; degPerUnit: number }
  | { kind: "along_normal"; distance: number };

/** All of a deformation that the viewer makes; null for those that only others make. */
function whole(wanted: Deformation): Residual | null {
  switch (wanted.type) {
    case "translation":
      return { kind: "translation", vector: wanted.vector };
    case "rotation":
      return {
        kind: "rotation",
        point: wanted.axis.point,
        direction: wanted.axis.direction,
        angleDeg: wanted.angle_deg,
      };
    case "scale":
      return { kind: "scale", point: wanted.center, from: [1, 1, 1], to: wanted.factors };
    case "twist":
      return {
        kind: "twist",
        point: wanted.axis.point,
        direction: wanted.axis.direction,
        degPerUnit: wanted.angle_deg / wanted.length,
      };
    case "along_normal":
      return { kind: "along_normal", distance: wanted.distance };
    case "toward_point":
    case "sequence":
      return null;
  }
}

function reversed(shown: Residual): Residual {
  switch (shown.kind) {
    case "translation":
      return { ...shown, vector: subtract([0, 0, 0], shown.vector) };
    case "rotation":
      return { ...shown, angleDeg: -shown.angleDeg };
    case "scale":
      return { ...shown, from: shown.to, to: shown.from };
    case "twist":
      return { ...shown, degPerUnit: -shown.degPerUnit };
    case "along_normal":
      return { ...shown, distance: -shown.distance };
  }
}

/** 1 or -1 where both axes are one line, in one sense or in opposite ones; 0 where they are not. */
function sameLine(a: { point: Vec3; direction: Vec3 }, b: { point: Vec3; direction: Vec3 }): number {
  const axis = normalise(a.direction);
  const offset = subtract(a.point, b.point);
  const along = dot(offset, axis);
  const apart = Math.sqrt(Math.max(0, dot(offset, offset) - along * along));
  const cosine = dot(normalise(b.direction), axis);
  const one = Math.abs(cosine) >= 1 - 1e-9 && apart <= 1e-9 * (1 + length(offset));
  return one ? Math.sign(cosine) : 0;
}

/**
 * What remains to be done to a surface that shows `shown`, so that it shows `wanted`. Exact between two of one kind and one
 * axis or centre, since both move a sample by its t alone; along the normal it is exact where t is 1, and near elsewhere.
 * Null where nothing remains, and where the two do not compose: then the picture waits for the server.
 */
export function residual(shown: Deformation | null, wanted: Deformation | null): Residual | null {
  const done = shown && !isIdentity(shown) ? shown : null;
  const due = wanted && !isIdentity(wanted) ? wanted : null;
  const from = done && whole(done);
  const to = due && whole(due);
  if (!from || !to) {
    if (done && due) return null;
    return to ?? (from && reversed(from));
  }
  if (from.kind === "translation" && to.kind === "translation")
    return { kind: "translation", vector: subtract(to.vector, from.vector) };
  if (from.kind === "along_normal" && to.kind === "along_normal")
    return { kind: "along_normal", distance: to.distance - from.distance };
  if (from.kind === "rotation" && to.kind === "rotation") {
    const sense = sameLine(to, from);
    return sense === 0 ? null : { ...to, angleDeg: to.angleDeg - sense * from.angleDeg };
  }
  // The height that a twist is measured by starts at the point, and turning the axis round turns its sign twice.
  const onePlace = (a: Vec3, b: Vec3): boolean => distance(a, b) <= 1e-9 * (1 + length(a));
  if (from.kind === "twist" && to.kind === "twist")
    return sameLine(to, from) !== 0 && onePlace(to.point, from.point)
      ? { ...to, degPerUnit: to.degPerUnit - from.degPerUnit }
      : null;
  if (from.kind === "scale" && to.kind === "scale")
    return onePlace(to.point, from.point) ? { ...to, from: from.to } : null;
  return null;
}

/** The residual in the coordinates of the scene. */
export function inScene(residual: Residual, toScene: (point: Vec3) => Vec3): Residual {
  return "point" in residual ? { ...residual, point: toScene(residual.point) } : residual;
}
