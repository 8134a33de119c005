import { cross, dot, normalise, scale, type Vec3 } from "./vec3";

export type Quaternion = readonly [x: number, y: number, z: number, w: number];

export const NO_TURN: Quaternion = [0, 0, 0, 1];

export interface AxisAngle {
  direction: Vec3;
  angleDeg: number;
}

/** The unit quaternion of an axis of any length and an angle. */
export function quaternionOf(axis: AxisAngle): Quaternion {
  const half = (axis.angleDeg * Math.PI) / 360;
  const [x, y, z] = scale(normalise(axis.direction), Math.sin(half));
  return [x, y, z, Math.cos(half)];
}

/** First `b`, then `a`. */
export function multiply(a: Quaternion, b: Quaternion): Quaternion {
  const [ax, ay, az, aw] = a;
  const [bx, by, bz, bw] = b;
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** The opposite turn of a unit quaternion. */
export function inverse(q: Quaternion): Quaternion {
  return [-q[0], -q[1], -q[2], q[3]];
}

/** The smallest turn that takes the z axis to `direction`. */
export function turnFromZ(direction: Vec3): Quaternion {
  const to = normalise(direction);
  const z: Vec3 = [0, 0, 1];
  const axis = cross(z, to);
  const angleDeg = (Math.atan2(Math.hypot(...axis), dot(z, to)) * 180) / Math.PI;
  return quaternionOf({ direction: normalise(axis, [1, 0, 0]), angleDeg });
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
