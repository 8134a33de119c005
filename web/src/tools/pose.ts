import type { ElementaryDeformation } from "../api/types";
import {
  alongNormal,
  GREATEST_FACTOR,
  LEAST_FACTOR,
  rotation,
  scaling,
  towardPoint,
  translation,
  twisting,
} from "../edits/deformation";
import type { TransformKind, TransformState } from "../event-map";
import {
  type AxisAngle,
  axisAngleOf,
  inverse,
  multiply,
  NO_TURN,
  quaternionOf,
  turnFromZ,
} from "../math/quaternion";
import { add, normalise, subtract, type Vec3 } from "../math/vec3";
import type { GizmoPose } from "../scene/gizmo";

/** The pose of the handles, in model space, as a deformation of that kind shows it. */
export function poseOf(kind: TransformKind, state: TransformState): GizmoPose {
  const { deformation, pivot, twist } = state;
  const still: GizmoPose = { position: pivot, quaternion: NO_TURN, scale: [1, 1, 1] };
  if (state.pivotEditing) return still;
  if (kind === "twist") {
    const angleDeg = deformation?.type === "twist" ? deformation.angle_deg : 0;
    const turned = quaternionOf({ direction: twist.direction, angleDeg });
    return { ...still, quaternion: multiply(turned, turnFromZ(twist.direction)) };
  }
  switch (deformation?.type) {
    case "translation":
      return { ...still, position: add(pivot, deformation.vector) };
    case "rotation":
      return {
        ...still,
        quaternion: quaternionOf({ direction: deformation.axis.direction, angleDeg: deformation.angle_deg }),
      };
    case "scale":
      return { ...still, scale: deformation.factors };
    default:
      return still;
  }
}

function turned(deformation: ElementaryDeformation | null): AxisAngle | undefined {
  if (deformation?.type !== "rotation" && deformation?.type !== "twist") return undefined;
  return { direction: normalise(deformation.axis.direction), angleDeg: deformation.angle_deg };
}

/** Handles that are drawn through the middle would turn the surface inside out: they stop short of it. */
function factorOf(scale: number): number {
  return Math.min(GREATEST_FACTOR, Math.max(LEAST_FACTOR, scale));
}

/** The deformation of that kind that the handles' pose, in model space, means. */
export function deformationOf(
  kind: TransformKind,
  state: TransformState,
  pose: GizmoPose,
): ElementaryDeformation {
  const { pivot, deformation, twist } = state;
  switch (kind) {
    case "move":
      return translation(subtract(pose.position, pivot));
    case "rotate": {
      const { direction, angleDeg } = axisAngleOf(pose.quaternion, turned(deformation));
      return rotation(pivot, direction, angleDeg);
    }
    case "scale":
      return scaling(pivot, pose.scale.map(factorOf) as unknown as Vec3);
    case "twist": {
      const about = multiply(pose.quaternion, inverse(turnFromZ(twist.direction)));
      const known = turned(deformation) ?? { direction: normalise(twist.direction), angleDeg: 0 };
      return twisting(pivot, twist.direction, axisAngleOf(about, known).angleDeg, twist.length);
    }
    case "toward":
      return towardPoint(pose.position, deformation?.type === "toward_point" ? deformation.amount : 0);
    case "normal":
      return alongNormal(deformation?.type === "along_normal" ? deformation.distance : 0);
  }
}
