import { Object3D, Vector3 } from "three";
import { TransformControls } from "three/examples/jsm/controls/TransformControls.js";
import type { Quaternion } from "../math/quaternion";
import type { Vec3 } from "../math/vec3";
import type { Viewport } from "./viewport";

export type GizmoMode = "translate" | "rotate" | "scale";
export type Axis = "x" | "y" | "z";

const AXIS_COLORS = { x: 0xe8665f, y: 0x7cc56a, z: 0x5b93f0, active: 0xf2c14e };

/** How far the middle handle is drawn to scale by e. */
const PIXELS_PER_E = 150;

export interface GizmoPose {
  position: Vec3;
  quaternion: Quaternion;
  scale: Vec3;
}

/** The handles on the surface. Poses are in scene coordinates; what they mean is the transform tool's. */
export class Gizmo {
  onDrag: ((pose: GizmoPose) => void) | null = null;
  onDragging: ((dragging: boolean) => void) | null = null;

  private readonly viewport_: Viewport;
  private readonly controls_: TransformControls;
  private readonly anchor_ = new Object3D();
  private dragging_ = false;
  private readonly listeners_ = new AbortController();
  /** Where the pointer is, and where it and the anchor's size were when a drag began. */
  private pointer_ = { x: 0, y: 0 };
  private start_ = { x: 0, y: 0, scale: new Vector3(1, 1, 1) };

  constructor(viewport: Viewport) {
    this.viewport_ = viewport;
    this.controls_ = new TransformControls(viewport.rig.camera, viewport.canvas);
    this.controls_.setColors(AXIS_COLORS.x, AXIS_COLORS.y, AXIS_COLORS.z, AXIS_COLORS.active);
    this.controls_.setSize(0.85);
    // A free turn about no axis in particular is nothing that a person could repeat or type.
    this.controls_.showXYZE = false;
    this.controls_.addEventListener("change", () => viewport.invalidateOverlay());
    this.controls_.addEventListener("dragging-changed", (event) => {
      this.dragging_ = event.value === true;
      this.start_ = { ...this.pointer_, scale: this.anchor_.scale.clone() };
      viewport.rig.setEnabled(!this.dragging_);
      this.onDragging?.(this.dragging_);
    });
    this.controls_.addEventListener("objectChange", () => {
      this.scaleEvenly();
      this.onDrag?.(this.pose);
    });
    const follow = ({ clientX: x, clientY: y }: PointerEvent): void => {
      this.pointer_ = { x, y };
    };
    // Before the controls see them.
    const options = { capture: true, signal: this.listeners_.signal };
    viewport.canvas.ownerDocument.addEventListener("pointermove", follow, options);
    viewport.canvas.ownerDocument.addEventListener("pointerdown", follow, options);
    viewport.overlay.add(this.anchor_, this.controls_.getHelper());
    this.hide();
  }

  get visible(): boolean {
    return this.controls_.object !== undefined;
  }

  get dragging(): boolean {
    return this.dragging_;
  }

  /** Whether the pointer is on a handle. */
  get hovered(): boolean {
    return this.visible && this.controls_.axis !== null;
  }

  get pose(): GizmoPose {
    const { x, y, z, w } = this.anchor_.quaternion;
    return {
      position: this.anchor_.position.toArray(),
      quaternion: [x, y, z, w],
      scale: this.anchor_.scale.toArray(),
    };
  }

  /** `own`: the handles stand along the pose's own axes rather than the model's. */
  show(mode: GizmoMode, pose: GizmoPose, own = false): void {
    this.controls_.setMode(mode);
    this.controls_.setSpace(own ? "local" : "world");
    this.anchor_.position.set(...pose.position);
    this.anchor_.quaternion.set(...pose.quaternion);
    this.anchor_.scale.set(...pose.scale);
    this.anchor_.updateMatrixWorld();
    this.controls_.attach(this.anchor_);
    this.viewport_.invalidateOverlay();
  }

  hide(): void {
    this.controls_.detach();
    this.viewport_.invalidateOverlay();
  }

  /** Leaves only one axis to drag; null gives all of them back. */
  constrain(axis: Axis | null): void {
    this.controls_.showX = axis === null || axis === "x";
    this.controls_.showY = axis === null || axis === "y";
    this.controls_.showZ = axis === null || axis === "z";
    this.viewport_.invalidateOverlay();
  }

  /** The middle handle scales by how far it is drawn to the right or up: its own distance from itself means nothing. */
  private scaleEvenly(): void {
    if (this.controls_.mode !== "scale" || this.controls_.axis !== "XYZ") return;
    const along = this.pointer_.x - this.start_.x - (this.pointer_.y - this.start_.y);
    this.anchor_.scale.copy(this.start_.scale).multiplyScalar(Math.exp(along / PIXELS_PER_E));
  }

  dispose(): void {
    this.listeners_.abort();
    this.controls_.detach();
    this.controls_.dispose();
    this.viewport_.overlay.remove(this.anchor_, this.controls_.getHelper());
  }
}
