import { MOUSE, PerspectiveCamera, TOUCH, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Vec3 } from "../math/vec3";
import {
  type CameraState,
  clipPlanes,
  FIELD_OF_VIEW_DEG,
  frameSphere,
  VIEWS,
  type ViewName,
} from "./camera-math";

export type UpAxis = "y" | "z";

const DEFAULT_DIRECTION: Vec3 = [0.42, 0.26, 1];

/** A direction of the y-up views, for an object that stands on another axis. */
function oriented(vector: Vec3, up: UpAxis): Vec3 {
  return up === "y" ? vector : [vector[0], -vector[2], vector[1]];
}

/** The camera and the hand on it. Tells `onChange` whenever the picture changes. */
export class CameraRig {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 100);
  private controls_: OrbitControls;
  private readonly element_: HTMLElement;
  private readonly onChange_: () => void;
  private center_: Vec3 = [0, 0, 0];
  private radius_ = 1;
  private up_: UpAxis = "y";
  private painting_ = false;
  private readonly damped_: boolean;

  constructor(element: HTMLElement, onChange: () => void) {
    this.element_ = element;
    this.onChange_ = onChange;
    this.damped_ = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls_ = this.makeControls();
  }

  get up(): UpAxis {
    return this.up_;
  }

  get state(): CameraState {
    return {
      position: this.camera.position.toArray(),
      target: this.controls_.target.toArray(),
      up: this.camera.up.toArray(),
    };
  }

  /** Turns the left button from orbiting to painting; the right one orbits then. */
  setPainting(painting: boolean): void {
    this.painting_ = painting;
    this.applyButtons();
  }

  setEnabled(enabled: boolean): void {
    this.controls_.enabled = enabled;
  }

  setBounds(center: Vec3, radius: number): void {
    this.center_ = center;
    this.radius_ = radius;
    this.controls_.minDistance = radius * 0.01;
    this.controls_.maxDistance = radius * 40;
    this.updateClip();
  }

  setState(state: CameraState): void {
    const up: UpAxis = Math.abs(state.up[2]) > Math.abs(state.up[1]) ? "z" : "y";
    if (up !== this.up_) this.setUp(up);
    this.camera.position.set(...state.position);
    this.controls_.target.set(...state.target);
    this.controls_.update();
    this.updateClip();
    this.onChange_();
  }

  /** Frames the whole object, or a sphere of it, from where the camera looks now. */
  frame(center: Vec3 = this.center_, radius = this.radius_): void {
    const direction = this.camera.position.clone().sub(this.controls_.target);
    this.setState(
      frameSphere(center, radius, this.camera.aspect, direction.toArray(), this.camera.up.toArray()),
    );
  }

  home(): void {
    const direction = oriented(DEFAULT_DIRECTION, this.up_);
    this.setState(
      frameSphere(this.center_, this.radius_, this.camera.aspect, direction, this.camera.up.toArray()),
    );
  }

  view(name: ViewName): void {
    const direction = oriented(VIEWS[name].direction, this.up_);
    this.setState(
      frameSphere(this.center_, this.radius_, this.camera.aspect, direction, this.camera.up.toArray()),
    );
  }

  setUp(up: UpAxis): void {
    this.up_ = up;
    const target = this.controls_.target.clone();
    // The controls read the up vector once, when they are made.
    this.controls_.dispose();
    this.camera.up.set(...oriented([0, 1, 0], up));
    this.controls_ = this.makeControls();
    this.controls_.target.copy(target);
    this.setBounds(this.center_, this.radius_);
    this.controls_.update();
  }

  setAspect(aspect: number): void {
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
  }

  /** Lets a flick run out; true while it still moves. */
  update(): boolean {
    return this.controls_.enabled && this.controls_.update();
  }

  /** Zooms and pans by keys, in parts of the view. */
  nudge(right: number, up: number, zoom: number): void {
    const offset = this.camera.position.clone().sub(this.controls_.target);
    const turnUp = new Vector3(...this.camera.up.toArray());
    offset.applyAxisAngle(turnUp, right);
    const side = offset.clone().cross(turnUp).normalize();
    offset.applyAxisAngle(side, up).multiplyScalar(zoom);
    this.camera.position.copy(this.controls_.target).add(offset);
    this.controls_.update();
    this.onChange_();
  }

  dispose(): void {
    this.controls_.dispose();
  }

  private updateClip(): void {
    const { near, far } = clipPlanes(this.camera.position.toArray(), this.center_, this.radius_);
    this.camera.near = near;
    this.camera.far = far;
    this.camera.updateProjectionMatrix();
  }

  private makeControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.element_);
    controls.enableDamping = this.damped_;
    controls.dampingFactor = 0.18;
    controls.zoomToCursor = true;
    controls.rotateSpeed = 0.9;
    controls.addEventListener("change", () => {
      this.updateClip();
      this.onChange_();
    });
    this.controls_ = controls;
    this.applyButtons();
    return controls;
  }

  private applyButtons(): void {
    // Left stays with orbiting: the brush takes the press before the controls see it, where it hits the surface.
    this.controls_.mouseButtons = {
      LEFT: MOUSE.ROTATE,
      MIDDLE: MOUSE.PAN,
      RIGHT: this.painting_ ? MOUSE.ROTATE : MOUSE.PAN,
    };
    this.controls_.touches = { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN };
  }
}
