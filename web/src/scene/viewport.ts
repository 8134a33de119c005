import { Scene, WebGLRenderer } from "three";
import type { Blend } from "../api/types";
import type { Residual } from "../edits/residual";
import { distance, type Vec3 } from "../math/vec3";
import { worldPerPixel } from "./camera-math";
import { CameraRig } from "./camera-rig";
import { DEFAULT_DISPLAY, type DisplaySettings } from "./display";
import { prefixWithin } from "./layers";
import { OutlineLayer } from "./outline-layer";
import { Pacer } from "./pacer";
import { Passes } from "./passes";
import { type Hit, Picker } from "./picker";
import { type RegionCentres, regionCentres } from "./region-centres";
import { SampleSurface, type SurfaceBlock, type SurfaceLayout } from "./sample-surface";
import { StrokeMask } from "./stroke-mask";
import { SurfaceStage } from "./surface-stage";
import { setResidual, setUniform, vectorUniform } from "./uniforms";
import { type FocusPlane, squareView } from "./view-matrix";

/** Pixels that the targets hold at most; beyond, the picture is drawn at a lower ratio and scaled up. */
const MAX_PIXELS = 8_500_000;

/** Splat radius in spacings (the root of the area that a sample stands for), where frames bring no radii. */
const SPLAT_SPACINGS = 1.45;

export interface BrushRing {
  position: Vec3;
  radius: number;
  color: readonly [number, number, number];
}

/** Whether the browser draws without a graphics card: then the handles' edges are not worth four samples a pixel. */
function isSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const renderer = names ? String(context?.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(renderer);
}

/** The picture: owns the canvas, the samples on the GPU and the loop that draws them when something has changed. */
export class Viewport {
  readonly canvas: HTMLCanvasElement;
  readonly rig: CameraRig;
  /** Drawn over the picture: the gizmo. */
  readonly overlay = new Scene();
  readonly mask: StrokeMask;
  readonly outline: OutlineLayer;
  /** After each picture; for the status line and the tests. */
  onDrawn: (() => void) | null = null;
  onContext: ((lost: boolean) => void) | null = null;

  private readonly container_: HTMLElement;
  private readonly renderer_: WebGLRenderer;
  private readonly passes_: Passes;
  private readonly picker_: Picker;
  private readonly pacer_ = new Pacer();
  private readonly observer_: ResizeObserver;
  private readonly stage_ = new SurfaceStage<SampleSurface>(
    (layout, room) => new SampleSurface(this.gl, layout, room),
  );
  private display_: DisplaySettings = DEFAULT_DISPLAY;
  private spacing_ = 0;
  private fullSamples_ = 0;
  private frame_ = 0;
  private timer_ = 0;
  private contextLost_ = false;
  private fence_: { sync: WebGLSync; since: number; drawn: number } | null = null;

  constructor(container: HTMLElement) {
    this.container_ = container;
    this.renderer_ = new WebGLRenderer({
      antialias: !isSoftware(),
      alpha: false,
      powerPreference: "high-performance",
    });
    this.renderer_.autoClear = false;
    this.canvas = this.renderer_.domElement;
    this.canvas.className = "viewport-canvas";
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute(
      "aria-label",
      "View of the surface. Arrow keys turn it, plus and minus zoom, F frames it.",
    );
    container.append(this.canvas);
    this.outline = new OutlineLayer(container);
    const gl = this.gl;
    if (!gl.getExtension("EXT_color_buffer_float"))
      throw new Error("This browser's WebGL 2 cannot draw into float textures.");
    this.passes_ = new Passes(this.renderer_);
    setUniform(
      this.passes_.uniforms.splat,
      "maxPointSize",
      (gl.getParameter(gl.ALIASED_POINT_SIZE_RANGE) as Float32Array)[1] ?? 64,
    );
    this.rig = new CameraRig(this.canvas, () => this.invalidate());
    this.picker_ = new Picker(this.renderer_, this.passes_.surfaceTarget, this.passes_.attributeTarget);
    this.mask = new StrokeMask(this.passes_, () => this.invalidateOverlay());
    this.passes_.setDisplay(this.display_);
    this.canvas.addEventListener("webglcontextlost", this.contextLost);
    this.canvas.addEventListener("webglcontextrestored", this.contextRestored);
    this.observer_ = new ResizeObserver(() => this.resize());
    this.observer_.observe(container);
    this.resize();
  }

  get gl(): WebGL2RenderingContext {
    return this.renderer_.getContext() as WebGL2RenderingContext;
  }

  /** Nothing waits to be drawn or refined. */
  get idle(): boolean {
    return (
      !this.contextLost_ &&
      this.fence_ === null &&
      this.frame_ === 0 &&
      this.timer_ === 0 &&
      this.pacer_.settled
    );
  }

  /** Draws for pictures that nobody waits at. */
  setPatient(patient: boolean): void {
    this.pacer_.patient = patient;
  }

  /** Of the frame that is drawn. */
  get loadedSamples(): number {
    return this.surface_?.loadedSamples ?? 0;
  }

  /** Of the frame that comes. */
  get arrivedSamples(): number {
    return this.stage_.coming?.loadedSamples ?? 0;
  }

  /** Whether a frame is on the screen whole. */
  get whole(): boolean {
    return this.stage_.whole;
  }

  get display(): DisplaySettings {
    return this.display_;
  }

  setDisplay(display: DisplaySettings): void {
    this.display_ = display;
    this.passes_.setDisplay(display);
    this.invalidate();
  }

  /** Median distance between neighbouring samples of the whole cloud, for the splats' size; a frame may have more samples. */
  setSpacing(spacing: number, fullSamples: number): void {
    this.spacing_ = spacing;
    this.fullSamples_ = fullSamples;
    this.invalidate();
  }

  /** A frame's blocks follow. */
  beginFrame(layout: SurfaceLayout, key: boolean): void {
    this.stage_.begin(layout, key);
    // The first one is on the screen while it comes.
    if (key && this.surface_ && !this.whole) this.passes_.setSurface(this.surface_);
  }

  /** Uploads one block; false where there is no surface that it belongs to. */
  putBlock(block: SurfaceBlock): boolean {
    if (this.contextLost_ || !this.stage_.put(block)) return false;
    if (this.stage_.coming === this.surface_) this.invalidate();
    return true;
  }

  setBounds(center: Vec3, radius: number): void {
    this.rig.setBounds(center, radius);
    setUniform(this.passes_.uniforms.shade, "objectRadius", Math.max(radius, 1e-12));
  }

  clearSurface(): void {
    this.stage_.clear();
    this.invalidate();
  }

  /** The deformation that the picture adds to the server's last frame, in scene coordinates, and the blend of its t. */
  setResidual(residual: Residual | null, blend: Blend | null): void {
    if (setResidual(this.passes_.uniforms.splat, residual, blend)) this.invalidate();
  }

  setRing(ring: BrushRing | null): void {
    const { present } = this.passes_.uniforms;
    if (!ring && !present["showRing"]?.value) return;
    setUniform(present, "showRing", ring !== null);
    if (ring) {
      vectorUniform(present, "ringCenter").copy(this.picker_.toView(ring.position));
      setUniform(present, "ringRadius", ring.radius);
      vectorUniform(present, "ringColor").set(...ring.color);
    }
    this.invalidateOverlay();
  }

  /** What lies under a point of the page. */
  pick(clientX: number, clientY: number): Hit | null {
    const box = this.canvas.getBoundingClientRect();
    return this.picker_.pick((clientX - box.left) / box.width, (clientY - box.top) / box.height);
  }

  /** The frame of this revision has come whole: it takes the screen, and what stood in for it goes. */
  endFrame(revision: number, preview: boolean): void {
    const before = this.surface_;
    this.stage_.end(!preview);
    if (this.surface_ && this.surface_ !== before) {
      this.passes_.setSurface(this.surface_);
      this.invalidate();
    }
    this.mask.frameShown(revision);
    this.outline.frameShown(revision);
  }

  get size(): { width: number; height: number } {
    return { width: this.container_.clientWidth, height: this.container_.clientHeight };
  }

  /** Where an event is in the picture, in pixels from its upper left corner. */
  pixelOf(event: MouseEvent): readonly [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** Model to the clip space of the square view, for a model whose origin is at `origin`. */
  squareView(origin: Vec3): number[] {
    const { camera } = this.rig;
    camera.updateMatrixWorld();
    return squareView(
      camera.projectionMatrix.elements,
      camera.matrixWorldInverse.elements,
      origin,
      this.size,
    );
  }

  /** The plane through the point that the camera turns about, facing the camera, in scene coordinates. */
  focusPlane(): FocusPlane {
    const { camera, state } = this.rig;
    const { width, height } = this.size;
    camera.updateMatrixWorld();
    const axis = (column: number): Vec3 =>
      [0, 1, 2].map((row) => camera.matrixWorld.elements[4 * column + row] ?? 0) as unknown as Vec3;
    return {
      focus: state.target,
      focusPixel: [width / 2, height / 2],
      right: axis(0),
      up: axis(1),
      perPixel: worldPerPixel(distance(state.position, state.target), height),
    };
  }

  regionCentres(): RegionCentres {
    if (!this.surface_) return { zero: null, one: null, boundary: null };
    const { blockSize, blockCount } = this.surface_.layout;
    return regionCentres({ ...this.surface_.readBack(), blockSize, blockCount });
  }

  /** Something of the picture has changed. */
  invalidate(): void {
    this.pacer_.change();
    this.schedule();
  }

  /** Only what is laid over has changed. */
  invalidateOverlay(): void {
    this.schedule();
  }

  dispose(): void {
    cancelAnimationFrame(this.frame_);
    clearTimeout(this.timer_);
    this.observer_.disconnect();
    this.rig.dispose();
    this.stage_.clear();
    this.renderer_.dispose();
    this.canvas.remove();
  }

  private get surface_(): SampleSurface | null {
    return this.stage_.front;
  }

  private schedule(): void {
    if (this.frame_ === 0 && !this.contextLost_) this.frame_ = requestAnimationFrame(this.tick);
  }

  private readonly tick = (now: number): void => {
    this.frame_ = 0;
    clearTimeout(this.timer_);
    this.timer_ = 0;
    // One picture at a time: what would pile up on a slow machine is never drawn, and a look at a pixel waits for one at most.
    if (!this.pictureFinished(now)) {
      this.schedule();
      return;
    }
    if (this.rig.update()) this.pacer_.change();
    const step = this.pacer_.next(now, this.surface_?.layout.sampleCount ?? 0);
    if (step.kind !== "none") this.drawPicture(step.budget, step.index, step.jitter, now);
    this.passes_.drawPresent(this.rig.camera);
    this.renderer_.render(this.overlay, this.rig.camera);
    this.onDrawn?.();
    const wait = this.pacer_.wait(performance.now());
    if (wait === 0 || this.fence_) this.schedule();
    else if (wait !== null)
      this.timer_ = window.setTimeout(() => {
        this.timer_ = 0;
        this.schedule();
      }, wait);
  };

  private pictureFinished(now: number): boolean {
    if (!this.fence_) return true;
    const { gl } = this;
    if (gl.clientWaitSync(this.fence_.sync, 0, 0) === gl.TIMEOUT_EXPIRED) return false;
    gl.deleteSync(this.fence_.sync);
    this.pacer_.finished(now - this.fence_.since, this.fence_.drawn, this.surface_?.layout.sampleCount ?? 0);
    this.fence_ = null;
    return true;
  }

  private drawPicture(budget: number, index: number, jitter: readonly [number, number], now: number): void {
    const { camera } = this.rig;
    const { x: width, y: height } = this.passes_.viewport;
    const { splat, shade } = this.passes_.uniforms;
    const surface = this.surface_;
    const prefix = surface ? prefixWithin(surface.prefixes, budget) : { blocks: 0, samples: 0 };
    // Fewer samples stand wider apart: their discs grow so that the surface stays closed.
    const shown = surface ? Math.max(1, Math.min(prefix.samples, Math.max(surface.loadedSamples, 1))) : 1;
    const full = Math.max(1, this.fullSamples_, surface?.layout.sampleCount ?? 0);
    const sparse = Math.sqrt(full / shown);
    const scale = Math.max(1, sparse) * this.display_.splatSize;
    setUniform(splat, "splatScale", scale);
    setUniform(splat, "splatRadius", this.spacing_ * SPLAT_SPACINGS * scale);
    setUniform(shade, "turn", index * 0.61);
    camera.setViewOffset(width, height, jitter[0], jitter[1], width, height);
    setUniform(splat, "pixelScale", height * 0.5 * camera.projectionMatrix.elements[5]);
    this.passes_.drawPicture(camera, prefix.blocks * (surface?.layout.blockSize ?? 0), 1 / (index + 1));
    camera.clearViewOffset();
    this.picker_.setCamera(camera);
    if (index === 0) this.mask.redraw(camera);
    const sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (sync) this.fence_ = { sync, since: now, drawn: prefix.samples };
  }

  private resize(): void {
    const width = Math.max(1, this.container_.clientWidth);
    const height = Math.max(1, this.container_.clientHeight);
    const wanted = Math.min(2, window.devicePixelRatio);
    const ratio = Math.min(wanted, Math.sqrt(MAX_PIXELS / (width * height)));
    this.renderer_.setPixelRatio(ratio);
    this.renderer_.setSize(width, height);
    this.passes_.setSize(this.canvas.width, this.canvas.height, ratio);
    this.rig.setAspect(width / height);
    this.invalidate();
  }

  private readonly contextLost = (event: Event): void => {
    event.preventDefault();
    this.contextLost_ = true;
    this.stage_.forget();
    this.fence_ = null;
    this.onContext?.(true);
  };

  private readonly contextRestored = (): void => {
    this.contextLost_ = false;
    this.invalidate();
    this.onContext?.(false);
  };
}
