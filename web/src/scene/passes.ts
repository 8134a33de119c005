import {
  AddEquation,
  BufferGeometry,
  CustomBlending,
  DataTexture,
  Float32BufferAttribute,
  FloatType,
  GLSL3,
  HalfFloatType,
  type IUniform,
  LinearFilter,
  Matrix4,
  Mesh,
  NearestFilter,
  NoBlending,
  NormalBlending,
  OneFactor,
  type PerspectiveCamera,
  Points,
  RawShaderMaterial,
  RGBAFormat,
  RGFormat,
  Scene,
  UnsignedByteType,
  Vector2,
  Vector3,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import { colormapTexels } from "./colormaps";
import { colormapOf, type DisplaySettings, MODE_NUMBERS } from "./display";
import type { SampleSurface } from "./sample-surface";
import { MASK_FRAGMENT, PRESENT_FRAGMENT, SCREEN_VERTEX, SHADE_FRAGMENT } from "./shaders/screen";
import { ATTRIBUTE_FRAGMENT, ATTRIBUTE_VERTEX, VISIBILITY_FRAGMENT, VISIBILITY_VERTEX } from "./shaders/splat";

export type Uniforms = Record<string, IUniform>;

/** sRGB colours of the regions, as the style sheet has them too. */
export const ZERO_COLOR: readonly [number, number, number] = [0.243, 0.482, 0.98];
export const ONE_COLOR: readonly [number, number, number] = [0.906, 0.294, 0.286];

const CLAY = [0.66, 0.635, 0.6] as const;

function toLinear(color: readonly [number, number, number]): Vector3 {
  const channel = (c: number): number => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return new Vector3(channel(color[0]), channel(color[1]), channel(color[2]));
}

function screenMaterial(fragment: string, uniforms: Uniforms, blending: typeof NormalBlending | typeof NoBlending): RawShaderMaterial {
  return new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: SCREEN_VERTEX,
    fragmentShader: fragment,
    uniforms,
    blending,
    depthTest: false,
    depthWrite: false,
    transparent: blending === NormalBlending,
  });
}

/** The render targets and shader passes from samples to the picture. Every matrix is the camera's that renders. */
export class Passes {
  /** Slot + 1 and distance of what is in front: for picking, lighting and the brush. */
  readonly surfaceTarget = new WebGLRenderTarget(1, 1, {
    format: RGFormat, type: FloatType, minFilter: NearestFilter, magFilter: NearestFilter, depthBuffer: true,
  });
  readonly attributeTarget = new WebGLRenderTarget(1, 1, {
    count: 2, format: RGBAFormat, type: HalfFloatType, minFilter: NearestFilter, magFilter: NearestFilter, depthBuffer: false,
  });
  private readonly picture_ = new WebGLRenderTarget(1, 1, {
    format: RGBAFormat, type: HalfFloatType, minFilter: LinearFilter, magFilter: LinearFilter, depthBuffer: false,
  });
  private readonly mask_ = new WebGLRenderTarget(1, 1, {
    format: RGBAFormat, type: UnsignedByteType, minFilter: NearestFilter, magFilter: NearestFilter, depthBuffer: false,
  });

  readonly viewport = new Vector2(1, 1);
  readonly splat: Uniforms = {
    blockTable: { value: null }, blockSize: { value: 4096 }, blockTableWidth: { value: 512 }, stretchRange: { value: 0 },
    splatRadius: { value: 1 }, pixelScale: { value: 1 }, maxPointSize: { value: 64 }, viewport: { value: this.viewport },
    residualKind: { value: 0 }, residualVector: { value: new Vector3() }, residualPoint: { value: new Vector3() },
    residualAngle: { value: 0 },
    mode: { value: 0 }, tintRegions: { value: true }, colormap: { value: null },
    clay: { value: toLinear(CLAY) }, zeroColor: { value: toLinear(ZERO_COLOR) }, oneColor: { value: toLinear(ONE_COLOR) },
    surface: { value: this.surfaceTarget.texture },
  };
  readonly shade: Uniforms = {
    surface: { value: this.surfaceTarget.texture }, albedo: { value: this.attributeTarget.textures[0] },
    normals: { value: this.attributeTarget.textures[1] }, viewport: { value: this.viewport }, pixelRatio: { value: 1 },
    edl: { value: 1 }, dataMode: { value: 0 }, objectRadius: { value: 1 }, turn: { value: 0 }, blend: { value: 1 },
    flatBackground: { value: false },
  };
  readonly present: Uniforms = {
    picture: { value: this.picture_.texture }, surface: { value: this.surfaceTarget.texture }, mask: { value: this.mask_.texture },
    viewport: { value: this.viewport }, pixelRatio: { value: 1 }, showMask: { value: false }, maskColor: { value: new Vector3() },
    showRing: { value: false }, ringCenter: { value: new Vector3() }, ringRadius: { value: 1 }, ringColor: { value: new Vector3() },
  };
  private readonly segment_: Uniforms = {
    surface: { value: this.surfaceTarget.texture }, viewport: { value: this.viewport },
    from: { value: new Vector3() }, to: { value: new Vector3() }, radius: { value: 1 },
  };

  private readonly renderer_: WebGLRenderer;
  private readonly splatScene_ = new Scene();
  private readonly screenScene_ = new Scene();
  private readonly points_ = new Points();
  private readonly quad_: Mesh;
  private readonly visibility_: RawShaderMaterial;
  private readonly attributes_: RawShaderMaterial;
  private readonly shadeMaterial_: RawShaderMaterial;
  private readonly maskMaterial_: RawShaderMaterial;
  private readonly presentMaterial_: RawShaderMaterial;
  private colormapName_ = "";

  constructor(renderer: WebGLRenderer) {
    this.renderer_ = renderer;
    this.visibility_ = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: VISIBILITY_VERTEX, fragmentShader: VISIBILITY_FRAGMENT, uniforms: this.splat, blending: NoBlending,
    });
    this.attributes_ = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: ATTRIBUTE_VERTEX, fragmentShader: ATTRIBUTE_FRAGMENT, uniforms: this.splat,
      blending: CustomBlending, blendEquation: AddEquation, blendSrc: OneFactor, blendDst: OneFactor, blendSrcAlpha: OneFactor,
      blendDstAlpha: OneFactor, depthTest: false, depthWrite: false,
    });
    this.shadeMaterial_ = screenMaterial(SHADE_FRAGMENT, this.shade, NormalBlending);
    this.maskMaterial_ = screenMaterial(MASK_FRAGMENT, this.segment_, NoBlending);
    this.presentMaterial_ = screenMaterial(PRESENT_FRAGMENT, this.present, NoBlending);
    const triangle = new BufferGeometry();
    triangle.setAttribute("position", new Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
    this.quad_ = new Mesh(triangle, this.shadeMaterial_);
    this.quad_.frustumCulled = false;
    this.points_.frustumCulled = false;
    this.screenScene_.add(this.quad_);
    this.splatScene_.add(this.points_);
  }

  setSize(width: number, height: number, pixelRatio: number): void {
    this.viewport.set(width, height);
    for (const target of [this.surfaceTarget, this.attributeTarget, this.picture_, this.mask_]) target.setSize(width, height);
    this.set(this.shade, "pixelRatio", pixelRatio);
    this.set(this.present, "pixelRatio", pixelRatio);
  }

  setSurface(surface: SampleSurface): void {
    this.points_.geometry = surface.geometry;
    this.set(this.splat, "blockTable", surface.blockTable);
    this.set(this.splat, "blockSize", surface.layout.blockSize);
    this.set(this.splat, "blockTableWidth", surface.blockTableWidth);
  }

  setDisplay(display: DisplaySettings): void {
    this.set(this.splat, "mode", MODE_NUMBERS[display.mode]);
    this.set(this.splat, "tintRegions", display.tintRegions);
    this.set(this.shade, "edl", display.depthCues ? 1 : 0);
    this.set(this.shade, "dataMode", display.mode === "shaded" || display.mode === "color" ? 0 : 1);
    const name = colormapOf(display) ?? "viridis";
    if (name === this.colormapName_) return;
    this.colormapName_ = name;
    const texture = new DataTexture(colormapTexels(name), 256, 1, RGBAFormat, UnsignedByteType);
    texture.minFilter = LinearFilter;
    texture.magFilter = LinearFilter;
    texture.needsUpdate = true;
    (this.splat["colormap"]?.value as DataTexture | null)?.dispose();
    this.set(this.splat, "colormap", texture);
  }

  /** Draws the first `slots` slots (0: nothing) into the picture; `blend` is the new picture's part in the accumulated one. */
  drawPicture(camera: PerspectiveCamera, slots: number, blend: number): void {
    const renderer = this.renderer_;
    renderer.setClearColor(0x000000, 0);
    this.points_.visible = slots > 0;
    this.points_.geometry.setDrawRange(0, slots);
    this.points_.material = this.visibility_;
    renderer.setRenderTarget(this.surfaceTarget);
    renderer.clear(true, true, false);
    renderer.render(this.splatScene_, camera);
    this.points_.material = this.attributes_;
    renderer.setRenderTarget(this.attributeTarget);
    renderer.clear(true, false, false);
    renderer.render(this.splatScene_, camera);
    this.set(this.shade, "blend", blend);
    renderer.setRenderTarget(this.picture_);
    this.drawScreen(this.shadeMaterial_, camera);
  }

  /** Adds a segment (view space) to the stroke's mask, or begins the mask anew. */
  drawMask(camera: PerspectiveCamera, from: Vector3, to: Vector3, radius: number, clear: boolean): void {
    this.renderer_.setRenderTarget(this.mask_);
    if (clear) this.renderer_.clear(true, false, false);
    (this.segment_["from"] as IUniform<Vector3>).value.copy(from);
    (this.segment_["to"] as IUniform<Vector3>).value.copy(to);
    this.set(this.segment_, "radius", radius);
    this.drawScreen(this.maskMaterial_, camera);
  }

  drawPresent(camera: PerspectiveCamera): void {
    this.renderer_.setRenderTarget(null);
    this.drawScreen(this.presentMaterial_, camera);
  }

  set(uniforms: Uniforms, name: string, value: unknown): void {
    const uniform = uniforms[name];
    if (!uniform) throw new Error(`no uniform "${name}"`);
    uniform.value = value;
  }

  private drawScreen(material: RawShaderMaterial, camera: PerspectiveCamera): void {
    this.quad_.material = material;
    this.renderer_.render(this.screenScene_, camera);
  }
}

/** A matrix that takes scene coordinates to the camera's. */
export function viewMatrixOf(camera: PerspectiveCamera): Matrix4 {
  return camera.matrixWorldInverse;
}
