import {
  AddEquation,
  BufferGeometry,
  CustomBlending,
  DataTexture,
  DepthTexture,
  Float32BufferAttribute,
  FloatType,
  GLSL3,
  HalfFloatType,
  LinearFilter,
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
  UnsignedIntType,
  Vector2,
  type Vector3,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import { colormapTexels } from "./colormaps";
import { colormapOf, type DisplaySettings, MODE_NUMBERS } from "./display";
import type { SampleSurface } from "./sample-surface";
import { MASK_FRAGMENT, PRESENT_FRAGMENT, SCREEN_VERTEX, SHADE_FRAGMENT } from "./shaders/screen";
import {
  ATTRIBUTE_FRAGMENT,
  ATTRIBUTE_VERTEX,
  VISIBILITY_FRAGMENT,
  VISIBILITY_VERTEX,
} from "./shaders/splat";
import { createUniforms, setUniform, type Uniforms, vectorUniform } from "./uniforms";

function screenMaterial(
  fragment: string,
  uniforms: Uniforms,
  blending: typeof NormalBlending | typeof NoBlending,
): RawShaderMaterial {
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
  /** Of the first pass; the second one tests against it, so that what is hidden costs nothing there. */
  private readonly depth_ = new DepthTexture(1, 1, UnsignedIntType);
  /** Slot + 1 and distance of what is in front: for picking, lighting and the brush. */
  readonly surfaceTarget = new WebGLRenderTarget(1, 1, {
    format: RGFormat,
    type: FloatType,
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthBuffer: true,
    depthTexture: this.depth_,
  });
  readonly attributeTarget = new WebGLRenderTarget(1, 1, {
    count: 2,
    format: RGBAFormat,
    type: HalfFloatType,
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthBuffer: true,
    depthTexture: this.depth_,
  });
  private readonly picture_ = new WebGLRenderTarget(1, 1, {
    format: RGBAFormat,
    type: HalfFloatType,
    minFilter: LinearFilter,
    magFilter: LinearFilter,
    depthBuffer: false,
  });
  private readonly mask_ = new WebGLRenderTarget(1, 1, {
    format: RGBAFormat,
    type: UnsignedByteType,
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthBuffer: false,
  });

  readonly viewport = new Vector2(1, 1);
  readonly uniforms = createUniforms(this.viewport, {
    surface: this.surfaceTarget.texture,
    albedo: this.attributeTarget.textures[0],
    normals: this.attributeTarget.textures[1],
    picture: this.picture_.texture,
    mask: this.mask_.texture,
  });

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
  private colormap_: DataTexture | null = null;

  constructor(renderer: WebGLRenderer) {
    this.renderer_ = renderer;
    this.visibility_ = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VISIBILITY_VERTEX,
      fragmentShader: VISIBILITY_FRAGMENT,
      uniforms: this.uniforms.splat,
      blending: NoBlending,
    });
    this.attributes_ = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: ATTRIBUTE_VERTEX,
      fragmentShader: ATTRIBUTE_FRAGMENT,
      uniforms: this.uniforms.splat,
      blending: CustomBlending,
      blendEquation: AddEquation,
      blendSrc: OneFactor,
      blendDst: OneFactor,
      blendSrcAlpha: OneFactor,
      blendDstAlpha: OneFactor,
      depthTest: true,
      depthWrite: false,
    });
    this.shadeMaterial_ = screenMaterial(SHADE_FRAGMENT, this.uniforms.shade, NormalBlending);
    this.maskMaterial_ = screenMaterial(MASK_FRAGMENT, this.uniforms.segment, NoBlending);
    this.presentMaterial_ = screenMaterial(PRESENT_FRAGMENT, this.uniforms.present, NoBlending);
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
    for (const target of [this.surfaceTarget, this.attributeTarget, this.picture_, this.mask_])
      target.setSize(width, height);
    setUniform(this.uniforms.shade, "pixelRatio", pixelRatio);
    setUniform(this.uniforms.present, "pixelRatio", pixelRatio);
  }

  setSurface(surface: SampleSurface): void {
    this.points_.geometry = surface.geometry;
    setUniform(this.uniforms.splat, "blockTable", surface.blockTable);
    setUniform(this.uniforms.splat, "blockSize", surface.layout.blockSize);
    setUniform(this.uniforms.splat, "blockTableWidth", surface.blockTableWidth);
    setUniform(this.uniforms.splat, "stretchRange", surface.layout.stretchRange);
  }

  setDisplay(display: DisplaySettings): void {
    setUniform(this.uniforms.splat, "mode", MODE_NUMBERS[display.mode]);
    setUniform(this.uniforms.splat, "tintRegions", display.tintRegions);
    setUniform(this.uniforms.shade, "edl", display.depthCues ? 1 : 0);
    setUniform(
      this.uniforms.shade,
      "dataMode",
      display.mode === "shaded" || display.mode === "color" ? 0 : 1,
    );
    const name = colormapOf(display) ?? "viridis";
    if (name === this.colormapName_) return;
    this.colormapName_ = name;
    const texture = new DataTexture(colormapTexels(name), 256, 1, RGBAFormat, UnsignedByteType);
    texture.minFilter = LinearFilter;
    texture.magFilter = LinearFilter;
    texture.needsUpdate = true;
    this.colormap_?.dispose();
    this.colormap_ = texture;
    setUniform(this.uniforms.splat, "colormap", texture);
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
    setUniform(this.uniforms.shade, "blend", blend);
    renderer.setRenderTarget(this.picture_);
    this.drawScreen(this.shadeMaterial_, camera);
  }

  /** Adds a segment (view space) to the stroke's mask, or begins the mask anew. */
  drawMask(camera: PerspectiveCamera, from: Vector3, to: Vector3, radius: number, clear: boolean): void {
    this.renderer_.setRenderTarget(this.mask_);
    if (clear) this.renderer_.clear(true, false, false);
    vectorUniform(this.uniforms.segment, "from").copy(from);
    vectorUniform(this.uniforms.segment, "to").copy(to);
    setUniform(this.uniforms.segment, "radius", radius);
    this.drawScreen(this.maskMaterial_, camera);
  }

  drawPresent(camera: PerspectiveCamera): void {
    this.renderer_.setRenderTarget(null);
    this.drawScreen(this.presentMaterial_, camera);
  }

  private drawScreen(material: RawShaderMaterial, camera: PerspectiveCamera): void {
    this.quad_.material = material;
    this.renderer_.render(this.screenScene_, camera);
  }
}
