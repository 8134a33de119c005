import type { Blend, Deformation, ElementaryDeformation } from "../api/types";
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

/** What is left of a length that is drawn to a point all the way: nothing that a normal could be turned by. */
const LEAST_LEFT = 1e-6;

/** All of a deformation; null for several steps. */
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
    case "toward_point": {
      // p + t amount (target - p) scales by 1 - t amount about the target.
      const left = Math.max(1 - wanted.amount, LEAST_LEFT);
      return { kind: "scale", point: wanted.target, from: [1, 1, 1], to: [left, left, left] };
    }
    case "sequence":
      return null;
  }
}

const stepsOf = (deformation: Deformation | null): readonly ElementaryDeformation[] =>
  deformation?.type === "sequence" ? deformation.steps : deformation ? [deformation] : [];

/** Both without the steps that they share before their last ones: those are on the screen already, whatever follows. */
function withoutShared(
  shown: Deformation | null,
  wanted: Deformation | null,
): [Deformation | null, Deformation | null] {
  const [a, b] = [stepsOf(shown), stepsOf(wanted)];
  let shared = 0;
  while (shared < Math.min(a.length, b.length) && JSON.stringify(a[shared]) === JSON.stringify(b[shared]))
    ++shared;
  const rest = (steps: readonly ElementaryDeformation[]): Deformation | null => {
    const left = steps.slice(shared);
    const [only] = left;
    return left.length > 1 ? { type: "sequence", steps: left } : (only ?? null);
  };
  return [rest(a), rest(b)];
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
  const moves = (each: Deformation | null): Deformation | null => (each && !isIdentity(each) ? each : null);
  const several = stepsOf(shown).length > 1 || stepsOf(wanted).length > 1;
  const [done, due] = several ? withoutShared(moves(shown), moves(wanted)) : [moves(shown), moves(wanted)];
  // The normal of a later step is not the edited level's.
  if (several && [...stepsOf(done), ...stepsOf(due)].some((step) => step.type === "along_normal"))
    return null;
  const from = done && whole(done);
  const to = due && whole(due);
  if (!from || !to) {
    if (done && due) return null;
    // What was drawn into one point cannot be drawn out of it.
    return (
      to ?? (from && done?.type === "toward_point" && done.amount > 0.99 ? null : from && reversed(from))
    );
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
  if (done?.type === "toward_point" && done.amount > 0.99) return null;
  if (from.kind === "scale" && to.kind === "scale")
    return onePlace(to.point, from.point) ? { ...to, from: from.to } : null;
  return null;
}

/** The residual in the coordinates of the scene. */
export function inScene(residual: Residual, toScene: (point: Vec3) => Vec3): Residual {
  return "point" in residual ? { ...residual, point: toScene(residual.point) } : residual;
}

/** What an edit is made under, beside its deformation. */
export interface Conditions {
  blend: Blend;
  /** The gains in words; empty where the detail stays as it is. */
  gains: string;
}

export interface Parameters {
  deformation: Deformation;
  under: Conditions;
}

export interface LookAhead {
  residual: Residual | null;
  /** What t of the frame, a quartic one, is turned into; null: it stays. */
  blend: Blend | null;
  /** Whether that is all of what is wanted: else the picture waits for the server. */
  covered: boolean;
}

/**
 * How the picture gets from the frame on the screen to what is wanted. `frameBlend`: which blend made the frame's t; null
 * where that is not known. Gains need the details of every band, which only the server has.
 */
export function lookAhead(
  shown: Parameters | null,
  wanted: Parameters | null,
  frameBlend: Blend | null,
): LookAhead {
  if (!wanted) return { residual: residual(shown?.deformation ?? null, null), blend: null, covered: true };
  const still = !shown || isIdentity(shown.deformation);
  const sameGains = (shown?.under.gains ?? "") === wanted.under.gains;
  const idle = isIdentity(wanted.deformation);
  const same = JSON.stringify(shown?.deformation) === JSON.stringify(wanted.deformation);
  const rest = residual(shown?.deformation ?? null, wanted.deformation);
  if (frameBlend === wanted.under.blend || (still && idle))
    return { residual: rest, blend: null, covered: sameGains && (rest !== null || same || (still && idle)) };
  // From quartic there is a way back to x; a deformation that is done already is done under its own t.
  if (still && frameBlend === "quartic")
    return { residual: rest, blend: wanted.under.blend, covered: sameGains && rest !== null };
  return { residual: still ? rest : null, blend: null, covered: false };
}
