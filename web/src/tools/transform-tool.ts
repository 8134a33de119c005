import type { TransformEditor } from "../edits/transform";
import type { ToolName, TransformKind, TransformState } from "../event-map";
import { distance, normalise, subtract } from "../math/vec3";
import type { Gizmo, GizmoMode, GizmoPose } from "../scene/gizmo";
import type { Viewport } from "../scene/viewport";
import type { Bus, SessionStore } from "../session-store";
import { deformationOf, poseOf } from "./pose";
import type { Tool } from "./tool";

/** What the handles of a kind do; none where numbers alone say it. */
const MODES: Record<TransformKind, GizmoMode | null> = {
  move: "translate",
  rotate: "rotate",
  scale: "scale",
  twist: "rotate",
  normal: null,
  // The handle is the target.
  toward: "translate",
};
/** A press that moves further is no click. */
const CLICK_PX = 4;

/** Deforms with the one-region by handles. Leaving the tool records what is pending; Escape drops it. */
export class TransformTool implements Tool {
  readonly name: TransformKind;
  private readonly bus_: Bus;
  private readonly viewport_: Viewport;
  private readonly gizmo_: Gizmo;
  private readonly store_: SessionStore;
  private readonly editor_: TransformEditor;
  private listeners_: AbortController | null = null;
  private unlisten_: (() => void)[] = [];
  private active_ = false;
  private pressed_ = { x: 0, y: 0 };

  constructor(
    name: TransformKind,
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
    this.editor_.begin(this.name);
    this.editor_.setAxis(null);
    this.centrePivot();
    this.gizmo_.onDrag = (pose) => this.dragged(pose);
    this.listeners_ = new AbortController();
    const { signal } = this.listeners_;
    const { canvas } = this.viewport_;
    canvas.addEventListener("dblclick", this.doubleClick, { signal });
    if (this.name === "toward") {
      canvas.addEventListener("pointerdown", this.press, { signal });
      canvas.addEventListener("click", this.click, { signal });
    }
    this.unlisten_ = [
      this.bus_.on("transform.changed", (state) => this.follow(state)),
      this.bus_.on("history.changed", () => this.centrePivot()),
    ];
    this.follow(this.editor_.state);
  }

  deactivate(next: ToolName): void {
    this.active_ = false;
    for (const end of this.unlisten_) end();
    this.listeners_?.abort();
    this.gizmo_.onDrag = null;
    this.gizmo_.hide();
    // Another kind is another step.
    if (this.editor_.keeps(next)) return;
    if (this.editor_.pending) void this.editor_.commit();
    else this.editor_.cancel();
  }

  /** Puts the pivot where the transform most likely starts: between the regions, or amid what moves or stays. */
  private centrePivot(): void {
    const { obstacle, deformation } = this.editor_.state;
    if (obstacle || (this.editor_.composing ? deformation !== null : this.editor_.pending)) return;
    const { zero, one, boundary } = this.viewport_.regionCentres();
    if (this.name === "twist" && zero && one && distance(zero, one) > 0) {
      // From the middle of what stays to the middle of what moves, which turns by the whole angle.
      this.editor_.setTwist({ direction: normalise(subtract(one, zero)), length: distance(zero, one) });
      this.editor_.setPivot(this.store_.toModel(zero));
      return;
    }
    const centre = this.name === "rotate" ? (boundary ?? one) : one;
    if (centre) this.editor_.setPivot(this.store_.toModel(centre));
  }

  private dragged(pose: GizmoPose): void {
    const { state } = this.editor_;
    const inModel = { ...pose, position: this.store_.toModel(pose.position) };
    if (state.pivotEditing || this.name === "toward") this.editor_.setPivot(inModel.position);
    else this.editor_.set(deformationOf(this.name, state, inModel));
  }

  /** Takes the handles where typed numbers, the pivot or the server put them. */
  private follow(state: TransformState): void {
    if (!this.active_) return;
    const mode = MODES[this.name];
    if (state.obstacle || !mode) {
      this.gizmo_.hide();
      return;
    }
    // A twist has one ring, about its own axis.
    const twists = this.name === "twist" && !state.pivotEditing;
    this.gizmo_.constrain(state.pivotEditing ? null : twists ? "z" : state.axis);
    if (this.gizmo_.dragging) return;
    const pose = poseOf(this.name, state);
    const inScene = { ...pose, position: this.store_.toScene(pose.position) };
    this.gizmo_.show(state.pivotEditing ? "translate" : mode, inScene, twists);
  }

  private readonly press = ({ clientX: x, clientY: y }: PointerEvent): void => {
    this.pressed_ = { x, y };
  };

  private readonly click = (event: MouseEvent): void => {
    const moved = Math.hypot(event.clientX - this.pressed_.x, event.clientY - this.pressed_.y);
    if (moved < CLICK_PX) this.doubleClick(event);
  };

  private readonly doubleClick = (event: MouseEvent): void => {
    if (this.gizmo_.hovered || !MODES[this.name]) return;
    const hit = this.viewport_.pick(event.clientX, event.clientY);
    if (hit) this.editor_.setPivot(this.store_.toModel(hit.position));
  };
}
