import type { Deformation, EditBody, ElementaryDeformation } from "../api/types";
import type { TransformKind } from "../event-map";
import { isFiniteVec3, length, type Vec3 } from "../math/vec3";

/** Limits of the server. */
export const LEAST_FACTOR = 1e-3;
export const GREATEST_FACTOR = 1e3;
const GREATEST_ANGLE_DEG = 36_000;
const GREATEST_LENGTH = 1e9;

export const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] } as const satisfies Record<string, Vec3>;

export function translation(vector: Vec3): ElementaryDeformation {
  return { type: "translation", vector };
}

export function rotation(point: Vec3, direction: Vec3, angleDeg: number): ElementaryDeformation {
  return { type: "rotation", axis: { point, direction }, angle_deg: angleDeg };
}

export function scaling(center: Vec3, factors: Vec3): ElementaryDeformation {
  return { type: "scale", center, factors };
}

/** `length`: the height along the axis over which the surface turns by the angle. */
export function twisting(
  point: Vec3,
  direction: Vec3,
  angleDeg: number,
  length: number,
): ElementaryDeformation {
  return { type: "twist", axis: { point, direction }, angle_deg: angleDeg, length };
}

export function alongNormal(distance: number): ElementaryDeformation {
  return { type: "along_normal", distance };
}

/** `amount`: 1 is all the way, a negative one leads away. */
export function towardPoint(target: Vec3, amount: number): ElementaryDeformation {
  return { type: "toward_point", target, amount };
}

/** The tool that makes deformations of a type. */
export const KIND_OF_TYPE: Record<ElementaryDeformation["type"], TransformKind> = {
  translation: "move",
  rotation: "rotate",
  scale: "scale",
  twist: "twist",
  along_normal: "normal",
  toward_point: "toward",
};

/** Whether a deformation moves nothing. */
export function isIdentity(deformation: Deformation): boolean {
  switch (deformation.type) {
    case "translation":
      return length(deformation.vector) === 0;
    case "along_normal":
      return deformation.distance === 0;
    case "toward_point":
      return deformation.amount === 0;
    case "scale":
      return deformation.factors.every((factor) => factor === 1);
    case "sequence":
      return deformation.steps.every(isIdentity);
    default:
      return deformation.angle_deg === 0;
  }
}

/** The same deformation about another pivot; null where it has none. */
export function withPivot(deformation: ElementaryDeformation, pivot: Vec3): ElementaryDeformation | null {
  if (deformation.type === "toward_point") return { ...deformation, target: pivot };
  if (deformation.type === "scale") return { ...deformation, center: pivot };
  if (deformation.type !== "rotation" && deformation.type !== "twist") return null;
  return { ...deformation, axis: { ...deformation.axis, point: pivot } };
}

/** What a deformation turns about, leaves in place or leads to; null where it has none. */
export function pivotOf(deformation: ElementaryDeformation): Vec3 | null {
  switch (deformation.type) {
    case "scale":
      return deformation.center;
    case "rotation":
    case "twist":
      return deformation.axis.point;
    case "toward_point":
      return deformation.target;
    default:
      return null;
  }
}

function axisFault(axis: { point: Vec3; direction: Vec3 }, angleDeg: number): string | null {
  if (!isFiniteVec3(axis.point)) return "The pivot needs three finite numbers.";
  if (!isFiniteVec3(axis.direction)) return "The axis needs three finite numbers.";
  if (length(axis.direction) === 0) return "The axis needs a direction other than zero.";
  if (!Number.isFinite(angleDeg)) return "The angle needs a finite number.";
  return Math.abs(angleDeg) <= GREATEST_ANGLE_DEG ? null : "The angle is 100 turns at most.";
}

/** Why a deformation cannot be sent; null where it can. */
export function deformationFault(deformation: Deformation): string | null {
  switch (deformation.type) {
    case "translation":
      return isFiniteVec3(deformation.vector) ? null : "The vector needs three finite numbers.";
    case "along_normal":
      return Math.abs(deformation.distance) <= GREATEST_LENGTH ? null : "The distance needs a finite number.";
    case "toward_point":
      if (!isFiniteVec3(deformation.target)) return "The target needs three finite numbers.";
      return deformation.amount >= -GREATEST_FACTOR && deformation.amount <= 1
        ? null
        : "The amount is 1 at most.";
    case "scale":
      if (!isFiniteVec3(deformation.center)) return "The pivot needs three finite numbers.";
      return deformation.factors.every((factor) => factor >= LEAST_FACTOR && factor <= GREATEST_FACTOR)
        ? null
        : `Each factor lies between ${LEAST_FACTOR} and ${GREATEST_FACTOR}.`;
    case "rotation":
      return axisFault(deformation.axis, deformation.angle_deg);
    case "twist": {
      const fault = axisFault(deformation.axis, deformation.angle_deg);
      if (fault) return fault;
      const { length } = deformation;
      return length >= 1 / GREATEST_LENGTH && length <= GREATEST_LENGTH ? null : "The length is above zero.";
    }
    case "sequence":
      return deformation.steps.map(deformationFault).find((fault) => fault !== null) ?? null;
  }
}

const list = (values: readonly number[]): string => values.map(formatNumber).join(", ");
const factorsText = (values: readonly number[]): string =>
  `${values.every((value) => value === values[0]) ? formatNumber(values[0] ?? 1) : list(values)}×`;

/** A deformation in words, for the history and the badge. */
export function describeDeformation(deformation: Deformation): string {
  switch (deformation.type) {
    case "translation":
      return `Moved ${list(deformation.vector)}`;
    case "along_normal":
      return `${deformation.distance < 0 ? "Carved" : "Raised"} ${formatNumber(Math.abs(deformation.distance))}`;
    case "toward_point":
      return `Drawn ${formatNumber(100 * deformation.amount)} % toward ${list(deformation.target)}`;
    case "rotation":
      return `Turned ${formatNumber(deformation.angle_deg)}° about ${list(deformation.axis.direction)}`;
    case "scale":
      return `Scaled ${factorsText(deformation.factors)}`;
    case "twist":
      return `Twisted ${formatNumber(deformation.angle_deg)}°`;
    case "sequence":
      return deformation.steps
        .map(describeDeformation)
        .map((step, i) => (i === 0 ? step : step.charAt(0).toLowerCase() + step.slice(1)))
        .join(", then ");
  }
}

/** An edit in words: what moved, and what became of the detail. */
export function describeEdit(edit: EditBody): string {
  const moved = describeDeformation(edit.deformation);
  if (!edit.gains) return moved;
  const detail = factorsText(edit.gains);
  return isIdentity(edit.deformation) ? `Detail ${detail}` : `${moved}, detail ${detail}`;
}

/** At most four significant digits. */
export function formatNumber(value: number): string {
  return String(Number(value.toPrecision(4)));
}
