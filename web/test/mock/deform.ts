import type { Blend, Deformation } from "../../src/api/types";
import type { Residual } from "../../src/edits/residual";
import { add, cross, dot, normalise, scale, subtract, type Vec3 } from "../../src/math/vec3";

/** Rodrigues' formula about a line. */
function turned(p: Vec3, axis: { point: Vec3; direction: Vec3 }, degrees: number): Vec3 {
  const direction = normalise(axis.direction);
  const from = subtract(p, axis.point);
  const angle = (degrees * Math.PI) / 180;
  const sine = scale(cross(direction, from), Math.sin(angle));
  const along = scale(direction, dot(direction, from) * (1 - Math.cos(angle)));
  return add(axis.point, add(scale(from, Math.cos(angle)), add(sine, along)));
}

/** F(p, t), as engine/editing/deformation.h defines each kind. */
export function deform(p: Vec3, deformation: Deformation, t: number, normal: Vec3 = [0, 0, 1]): Vec3 {
  switch (deformation.type) {
    case "translation":
      return add(p, scale(deformation.vector, t));
    case "along_normal":
      return add(p, scale(normal, t * deformation.distance));
    case "toward_point":
      return add(p, scale(subtract(deformation.target, p), t * deformation.amount));
    case "rotation":
      return turned(p, deformation.axis, t * deformation.angle_deg);
    case "scale": {
      const { center, factors } = deformation;
      const from = subtract(p, center);
      const by = (k: 0 | 1 | 2): number => (1 + t * (factors[k] - 1)) * from[k];
      return add(center, [by(0), by(1), by(2)]);
    }
    case "twist": {
      const { axis, angle_deg, length } = deformation;
      const height = dot(normalise(axis.direction), subtract(p, axis.point));
      return turned(p, axis, (t * angle_deg * height) / length);
    }
    case "sequence":
      return deformation.steps.reduce((q, step) => deform(q, step, t, normal), p);
  }
}

/** `reblend` of src/scene/shaders/splat.ts, statement by statement. */
export function reblended(t: number, blend: Blend): number {
  if (blend === "quartic") return t;
  const x = Math.sqrt(Math.max(0, 1 - Math.sqrt(t)));
  const y = 1 - x;
  if (blend === "cubic") return y * y * (1 + 2 * x);
  if (blend === "quintic") return y * y * y * (1 + 3 * x + 6 * x * x);
  return 0.5 + 0.5 * Math.cos(Math.PI * x);
}

/** What the vertex shader makes of a sample, statement by statement as `deformAhead` in src/scene/shaders/splat.ts has it. */
export function ahead(p: Vec3, normal: Vec3, t: number, rest: Residual): { p: Vec3; normal: Vec3 } {
  const turn = (v: Vec3, axis: Vec3, degrees: number): Vec3 =>
    turned(v, { point: [0, 0, 0], direction: axis }, degrees);
  const from = "point" in rest ? subtract(p, rest.point) : p;
  switch (rest.kind) {
    case "translation":
      return { p: add(p, scale(rest.vector, t)), normal };
    case "rotation":
      return {
        p: add(rest.point, turn(from, rest.direction, t * rest.angleDeg)),
        normal: turn(normal, rest.direction, t * rest.angleDeg),
      };
    case "scale": {
      const by = (k: 0 | 1 | 2): number => (1 + t * (rest.to[k] - 1)) / (1 + t * (rest.from[k] - 1));
      return {
        p: add(rest.point, [by(0) * from[0], by(1) * from[1], by(2) * from[2]]),
        normal: normalise([normal[0] / by(0), normal[1] / by(1), normal[2] / by(2)]),
      };
    }
    case "twist": {
      const axis = normalise(rest.direction);
      const degrees = t * rest.degPerUnit * dot(axis, from);
      const shear = scale(cross(axis, from), (t * rest.degPerUnit * Math.PI) / 180);
      const across = subtract(normal, scale(axis, dot(shear, normal)));
      return {
        p: add(rest.point, turn(from, axis, degrees)),
        normal: normalise(turn(across, axis, degrees)),
      };
    }
    case "along_normal":
      return { p: add(p, scale(normal, t * rest.distance)), normal };
  }
}
