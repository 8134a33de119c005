import { PerspectiveCamera, Vector3, type WebGLRenderer, type WebGLRenderTarget } from "three";
import type { Vec3 } from "../math/vec3";

/** A place on the surface under the cursor, in scene coordinates. */
export interface Hit {
  slot: number;
  position: Vec3;
  /** Towards the camera. */
  normal: Vec3;
  /** From the surface to the camera, unit. */
  towardsCamera: Vec3;
  /** Along the view axis. */
  depth: number;
}

const REACH = 2;
const SIDE = 2 * REACH + 1;

/** Reads the picture's own first passes back, a few pixels at a time: no sample is tested one by one. */
export class Picker {
  private readonly renderer_: WebGLRenderer;
  private readonly surface_: WebGLRenderTarget;
  private readonly attributes_: WebGLRenderTarget;
  private readonly camera_ = new PerspectiveCamera();
  private readonly pixels_ = new Float32Array(SIDE * SIDE * 4);
  private readonly normal_ = new Float32Array(4);

  constructor(renderer: WebGLRenderer, surface: WebGLRenderTarget, attributes: WebGLRenderTarget) {
    this.renderer_ = renderer;
    this.surface_ = surface;
    this.attributes_ = attributes;
  }

  /** The camera that the targets were drawn with. */
  setCamera(camera: PerspectiveCamera): void {
    this.camera_.copy(camera, false);
    this.camera_.updateMatrixWorld();
  }

  toView(position: Vec3): Vector3 {
    return new Vector3(...position).applyMatrix4(this.camera_.matrixWorldInverse);
  }

  /** What lies at fractions of the picture (from its upper left corner), or within two pixels of it. */
  pick(u: number, v: number): Hit | null {
    const { width, height } = this.surface_;
    const x = Math.floor(u * width);
    const y = Math.floor((1 - v) * height);
    if (x < REACH || y < REACH || x >= width - REACH || y >= height - REACH) return null;
    this.read(this.surface_, 0, x - REACH, y - REACH, SIDE, this.pixels_);
    const found = this.nearest();
    if (!found) return null;
    const px = x - REACH + found.column;
    const py = y - REACH + found.row;
    this.read(this.attributes_, 1, px, py, 1, this.normal_);
    const camera = this.camera_;
    const projection = camera.projectionMatrix.elements;
    const viewX =
      ((((px + 0.5) / width) * 2 - 1 + (projection[8] ?? 0)) / (projection[0] ?? 1)) * found.depth;
    const viewY =
      ((((py + 0.5) / height) * 2 - 1 + (projection[9] ?? 0)) / (projection[5] ?? 1)) * found.depth;
    const at = new Vector3(viewX, viewY, -found.depth);
    const towards = at.clone().negate().normalize();
    const normal = new Vector3(this.normal_[0], this.normal_[1], this.normal_[2]);
    if (normal.lengthSq() === 0) normal.copy(towards);
    const world = camera.matrixWorld;
    return {
      slot: found.slot,
      position: at.clone().applyMatrix4(world).toArray(),
      normal: normal.normalize().transformDirection(world).toArray(),
      towardsCamera: towards.transformDirection(world).toArray(),
      depth: found.depth,
    };
  }

  private nearest(): { slot: number; depth: number; column: number; row: number } | null {
    let best: { slot: number; depth: number; column: number; row: number } | null = null;
    let least = Number.POSITIVE_INFINITY;
    for (let row = 0; row < SIDE; ++row) {
      for (let column = 0; column < SIDE; ++column) {
        const at = 4 * (row * SIDE + column);
        const slot = this.pixels_[at] ?? 0;
        const away = (row - REACH) ** 2 + (column - REACH) ** 2;
        if (slot === 0 || away >= least) continue;
        least = away;
        best = { slot: slot - 1, depth: this.pixels_[at + 1] ?? 0, column, row };
      }
    }
    return best;
  }

  private read(
    target: WebGLRenderTarget,
    texture: number,
    x: number,
    y: number,
    side: number,
    into: Float32Array,
  ): void {
    const gl = this.renderer_.getContext() as WebGL2RenderingContext;
    this.renderer_.setRenderTarget(target);
    gl.readBuffer(gl.COLOR_ATTACHMENT0 + texture);
    gl.readPixels(x, y, side, side, gl.RGBA, gl.FLOAT, into);
    if (texture !== 0) gl.readBuffer(gl.COLOR_ATTACHMENT0);
    this.renderer_.setRenderTarget(null);
  }
}
