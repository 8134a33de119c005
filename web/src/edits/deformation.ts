import type { Deformation } from "../api/types";
import { dot, isFiniteVec3, length, normalise, scale, type Vec3 } from "../math/vec3";

export type Quaternion = readonly [x: number, y: number, z: number, w: number];

export interface AxisAngle {
  direction: Vec3;
  angleDeg: number;
}

/**
 * The axis and angle of a unit quaternion, continued from `previous`: of all the pairs that mean the same rotation, the one
 * about the same axis whose angle is nearest. So a gizmo that is turned on and on counts beyond half a turn.
 */
export function axisAngleOf(quaternion: Quaternion, previous?: AxisAngle): AxisAngle {
  const [x, y, z, w] = quaternion;
  const sine = Math.hypot(x, y, z);
  let direction: Vec3 = sine > 1e-9 ? [x / sine, y / sine, z / sine] : (previous?.direction ?? [0, 0, 1]);
  let angleDeg = (2 * Math.atan2(sine, w) * 180) / Math.PI;
  if (previous && Math.abs(dot(direction, previous.direction)) > 0.999) {
    if (dot(direction, previous.direction) < 0) {
      direction = scale(direction, -1);
      angleDeg = -angleDeg;
    }
    angleDeg += 360 * Math.round((previous.angleDeg - angleDeg) / 360);
  } else if (angleDeg > 180) {
    angleDeg -= 360;
  }
  return { direction, angleDeg };
}

export function translation(vector: Vec3): Deformation {
  return { type: "translation", vector };
}

export function rotation(point: Vec3, direction: Vec3, angleDeg: number): Deformation {
  return { type: "rotation", axis: { point, direction }, angle_deg: angleDeg };
}

/** Whether a deformation moves nothing. */
export function isIdentity(deformation: Deformation): boolean {
  return deformation.type === "translation" ? length(deformation.vector) === 0 : deformation.angle_deg === 0;
}

/** Why a deformation cannot be sent; null where it can. */
export function deformationFault(deformation: Deformation): string | null {
  if (deformation.type === "translation") {
    return isFiniteVec3(deformation.vector) ? null : "The vector needs three finite numbers.";
  }
  if (!isFiniteVec3(deformation.axis.point)) return "The pivot needs three finite numbers.";
  if (!isFiniteVec3(deformation.axis.direction)) return "The axis needs three finite numbers.";
  if (length(deformation.axis.direction) === 0) return "The axis needs a direction other than zero.";
  return Number.isFinite(deformation.angle_deg) ? null : "The angle needs a finite number.";
}

/**
 * What remains to be done to a surface that shows `shown`, so that it shows `wanted`: exact for the closed forms of one
 * kind and one axis, since both move a sample in proportion to its t. Null where the two do not compose.
 */
export function residual(shown: Deformation | null, wanted: Deformation | null): Deformation | null {
  if (!wanted || wanted.type === "translation") {
    const to = wanted?.vector ?? [0, 0, 0];
    if (!shown) return translation(to);
    if (shown.type === "translation") {
      return translation([to[0] - shown.vector[0], to[1] - shown.vector[1], to[2] - shown.vector[2]]);
    }
    return wanted ? null : rotation(shown.axis.point, shown.axis.direction, -shown.angle_deg);
  }
  if (!shown) return wanted;
  if (shown.type !== "rotation") return null;
  const from = normalise(shown.axis.direction);
  const axis = normalise(wanted.axis.direction);
  const offset: Vec3 = [
    wanted.axis.point[0] - shown.axis.point[0],
    wanted.axis.point[1] - shown.axis.point[1],
    wanted.axis.point[2] - shown.axis.point[2],
  ];
  const along = dot(offset, axis);
  const apart = Math.sqrt(Math.max(0, dot(offset, offset) - along * along));
  const cosine = dot(from, axis);
  if (Math.abs(cosine) < 1 - 1e-9 || apart > 1e-9 * (1 + length(offset))) return null;
  return rotation(
    wanted.axis.point,
    wanted.axis.direction,
    wanted.angle_deg - Math.sign(cosine) * shown.angle_deg,
  );
}

/** A deformation in words, for the history and the badge. */
export function describeDeformation(deformation: Deformation): string {
  if (deformation.type === "translation") {
    return `Move ${deformation.vector.map((value) => formatNumber(value)).join(", ")}`;
  }
  return `Rotate ${formatNumber(deformation.angle_deg)}° about ${deformation.axis.direction.map((v) => formatNumber(v)).join(", ")}`;
}

/** At most four significant digits. */
export function formatNumber(value: number): string {
  return String(Number(value.toPrecision(4)));
}
