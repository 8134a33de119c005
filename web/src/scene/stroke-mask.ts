import { type PerspectiveCamera, Vector3 } from "three";
import type { Vec3 } from "../math/vec3";
import type { Passes } from "./passes";
import { setUniform, vectorUniform } from "./uniforms";

interface Segment {
  from: Vec3;
  to: Vec3;
  radius: number;
}

/**
 * The stroke's own tint, shown at once, until the server's marks come: each segment is drawn once into a mask over the
 * picture, tested against the distances of the surface. However long the stroke, a new segment costs one pass.
 */
export class StrokeMask {
  private readonly passes_: Passes;
  private readonly changed_: () => void;
  private readonly segments_: Segment[] = [];
  private camera_: PerspectiveCamera | null = null;
  private frameRevision_ = 0;
  private until_: number | null = null;

  constructor(passes: Passes, changed: () => void) {
    this.passes_ = passes;
    this.changed_ = changed;
  }

  begin(color: readonly [number, number, number]): void {
    this.segments_.length = 0;
    this.until_ = null;
    vectorUniform(this.passes_.uniforms.present, "maskColor").set(...color);
  }

  add(from: Vec3, to: Vec3, radius: number): void {
    this.segments_.push({ from, to, radius });
    if (this.camera_) this.draw(this.camera_, this.segments_.length - 1);
    setUniform(this.passes_.uniforms.present, "showMask", true);
    this.changed_();
  }

  /** Clears once a frame of `revision` or later is on the screen, or now where one is. */
  clearAtRevision(revision: number): void {
    this.until_ = revision;
    this.frameShown(this.frameRevision_);
  }

  frameShown(revision: number): void {
    this.frameRevision_ = revision;
    if (this.until_ !== null && revision >= this.until_) this.clear();
  }

  clear(): void {
    this.segments_.length = 0;
    this.until_ = null;
    setUniform(this.passes_.uniforms.present, "showMask", false);
    this.changed_();
  }

  /** Draws all segments anew, for a camera that has moved. */
  redraw(camera: PerspectiveCamera): void {
    this.camera_ = camera;
    for (let i = 0; i < this.segments_.length; ++i) this.draw(camera, i);
  }

  private draw(camera: PerspectiveCamera, index: number): void {
    const segment = this.segments_[index];
    if (!segment) return;
    const from = new Vector3(...segment.from).applyMatrix4(camera.matrixWorldInverse);
    const to = new Vector3(...segment.to).applyMatrix4(camera.matrixWorldInverse);
    this.passes_.drawMask(camera, from, to, segment.radius, index === 0);
  }
}
