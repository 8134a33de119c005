import { type AxisAngle, axisAngleOf, rotation, translation } from "../edits/deformation";
import type { TransformEditor } from "../edits/transform";
import type { TransformState } from "../event-map";
import { add, subtract, type Vec3 } from "../math/vec3";
import type { Gizmo, GizmoPose } from "../scene/gizmo";
import type { Viewport } from "../scene/viewport";
import type { Bus, SessionStore } from "../session-store";
import type { Tool } from "./tool";

const IDENTITY = [0, 0, 0, 1] as const;

/** A unit quaternion of an axis and an angle. */
function quaternionOf(axis: AxisAngle): [number, number, number, number] {
  const half = (axis.angleDeg * Math.PI) / 360;
  const length = Math.hypot(...axis.direction) || 1;
  const sine = Math.sin(half) / length;
  return [axis.direction[0] * sine, axis.direction[1] * sine, axis.direction[2] * sine, Math.cos(half)];
}

/** Moves or turns the one-region by handles. Leaving the tool records what is pending; Escape drops it. */
export class TransformTool implements Tool {
  readonly name: "move" | "rotate";
  private readonly bus_: Bus;
  private readonly viewport_: Viewport;
  private readonly gizmo_: Gizmo;
  private readonly store_: SessionStore;
  private readonly editor_: TransformEditor;
  private listeners_: AbortController | null = null;
  private unlisten_: (() => void)[] = [];
  private axisAngle_: AxisAngle | undefined;
  private active_ = false;

  constructor(
    name: "move" | "rotate",
    bus: Bus,
    viewport: Viewport,
    gizmo: Gizmo,
    store: SessionStore,
    editor: TransformEditor,
  ) {
    this.name = name;
    this.bus_ = bus;
    this.viewport_ = viewport;
    this.gizmo_ = gizmo;
    this.store_ = store;
    this.editor_ = editor;
  }

  activate(): void {
    this.active_ = true;
    this.axisAngle_ = undefined;
    this.editor_.setAxis(null);
    this.centrePivot();
    this.gizmo_.onDrag = (pose) => this.dragged(pose);
    this.listeners_ = new AbortController();
    this.viewport_.canvas.addEventListener("dblclick", this.doubleClick, { signal: this.listeners_.signal });
    this.unlisten_ = [
      this.bus_.on("transform.changed", (state) => this.follow(state)),
      this.bus_.on("history.changed", () => this.centrePivot()),
    ];
    this.follow(this.editor_.state);
  }

  deactivate(): void {
    this.active_ = false;
    for (const end of this.unlisten_) end();
    this.listeners_?.abort();
    this.gizmo_.onDrag = null;
    this.gizmo_.hide();
    if (this.editor_.pending) void this.editor_.commit();
    else this.editor_.cancel();
  }

  /** Puts the pivot where the transform most likely turns: between the regions, or amid what moves. */
  private centrePivot(): void {
    if (this.editor_.state.obstacle || this.editor_.pending) return;
    const centres = this.viewport_.regionCentres();
    const centre = this.name === "rotate" ? (centres.boundary ?? centres.one) : centres.one;
    if (centre) this.editor_.setPivot(this.store_.toModel(centre));
  }

  private dragged(pose: GizmoPose): void {
    const { pivot, pivotEditing, deformation } = this.editor_.state;
    const position = this.store_.toModel(pose.position);
    if (pivotEditing) {
      this.editor_.setPivot(position);
    } else if (this.name === "move") {
      this.editor_.set(translation(subtract(position, pivot)));
    } else {
      const previous: AxisAngle | undefined =
        deformation?.type === "rotation"
          ? { direction: deformation.axis.direction, angleDeg: deformation.angle_deg }
          : undefined;
      this.axisAngle_ = axisAngleOf(pose.quaternion, previous);
      this.editor_.set(rotation(pivot, this.axisAngle_.direction, this.axisAngle_.angleDeg));
    }
  }

  /** Takes the handles where typed numbers, the pivot or the server put them. */
  private follow(state: TransformState): void {
    if (!this.active_) return;
    if (state.obstacle) {
      this.gizmo_.hide();
      return;
    }
    this.gizmo_.constrain(state.pivotEditing ? null : state.axis);
    if (this.gizmo_.dragging) return;
    const mode = this.name === "move" || state.pivotEditing ? "translate" : "rotate";
    this.gizmo_.show(mode, this.poseOf(state));
  }

  private poseOf(state: TransformState): GizmoPose {
    const { deformation } = state;
    let position: Vec3 = state.pivot;
    if (deformation?.type === "translation" && !state.pivotEditing)
      position = add(position, deformation.vector);
    const turned = deformation?.type === "rotation" && !state.pivotEditing;
    return {
      position: this.store_.toScene(position),
      quaternion: turned
        ? quaternionOf({ direction: deformation.axis.direction, angleDeg: deformation.angle_deg })
        : IDENTITY,
    };
  }

  private readonly doubleClick = (event: MouseEvent): void => {
    if (this.gizmo_.hovered) return;
    const hit = this.viewport_.pick(event.clientX, event.clientY);
    if (hit) this.editor_.setPivot(this.store_.toModel(hit.position));
  };
}
