import { type Texture, type Vector2, Vector3 } from "three";
import type { Blend } from "../api/types";
import type { Residual } from "../edits/residual";
import { normalise } from "../math/vec3";
import { ONE_COLOR, ZERO_COLOR } from "./region-colors";

/** Uniforms by name: what the shaders read, in the types that three.js hands on. */
export interface Uniforms {
  [name: string]: { value: unknown };
}

const CLAY = [0.66, 0.635, 0.6] as const;

function toLinear(color: readonly [number, number, number]): Vector3 {
  const channel = (c: number): number => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return new Vector3(channel(color[0]), channel(color[1]), channel(color[2]));
}

/** Sets one uniform; a name that no shader knows is a mistake. */
export function setUniform(uniforms: Uniforms, name: string, value: unknown): void {
  const uniform = uniforms[name];
  if (!uniform) throw new Error(`no uniform "${name}"`);
  uniform.value = value;
}

/** The vector that a uniform holds, to be written into. */
export function vectorUniform(uniforms: Uniforms, name: string): Vector3 {
  const value = uniforms[name]?.value;
  if (!(value instanceof Vector3)) throw new Error(`no vector "${name}"`);
  return value;
}

/** The textures through which the passes hand on. */
export interface PassTextures {
  surface: Texture;
  albedo: Texture | undefined;
  normals: Texture | undefined;
  picture: Texture;
  mask: Texture;
}

export interface PassUniforms {
  /** Of both splat passes. */
  splat: Uniforms;
  shade: Uniforms;
  /** Of a segment of the stroke's mask. */
  segment: Uniforms;
  present: Uniforms;
}

export function createUniforms(viewport: Vector2, textures: PassTextures): PassUniforms {
  const splat: Uniforms = {
    blockTable: { value: null },
    blockSize: { value: 4096 },
    blockTableWidth: { value: 512 },
    stretchRange: { value: 0 },
    splatRadius: { value: 1 },
    splatScale: { value: 1 },
    pixelScale: { value: 1 },
    maxPointSize: { value: 64 },
    viewport: { value: viewport },
    residualKind: { value: 0 },
    residualVector: { value: new Vector3() },
    residualPoint: { value: new Vector3() },
    residualFrom: { value: new Vector3() },
    residualAmount: { value: 0 },
    residualBlend: { value: 0 },
    mode: { value: 0 },
    tintRegions: { value: true },
    colormap: { value: null },
    clay: { value: toLinear(CLAY) },
    zeroColor: { value: toLinear(ZERO_COLOR) },
    oneColor: { value: toLinear(ONE_COLOR) },
    surface: { value: textures.surface },
  };
  const shade: Uniforms = {
    surface: { value: textures.surface },
    albedo: { value: textures.albedo },
    normals: { value: textures.normals },
    viewport: { value: viewport },
    pixelRatio: { value: 1 },
    edl: { value: 1 },
    dataMode: { value: 0 },
    objectRadius: { value: 1 },
    turn: { value: 0 },
    blend: { value: 1 },
    flatBackground: { value: false },
  };
  const segment: Uniforms = {
    surface: { value: textures.surface },
    viewport: { value: viewport },
    from: { value: new Vector3() },
    to: { value: new Vector3() },
    radius: { value: 1 },
  };
  const present: Uniforms = {
    picture: { value: textures.picture },
    surface: { value: textures.surface },
    mask: { value: textures.mask },
    viewport: { value: viewport },
    pixelRatio: { value: 1 },
    showMask: { value: false },
    maskColor: { value: new Vector3() },
    showRing: { value: false },
    ringCenter: { value: new Vector3() },
    ringRadius: { value: 1 },
    ringColor: { value: new Vector3() },
  };
  return { splat, shade, segment, present };
}

/** As the vertex shader numbers them. */
const RESIDUAL_KINDS: Record<Residual["kind"], number> = {
  translation: 1,
  rotation: 2,
  scale: 3,
  twist: 4,
  along_normal: 5,
};
/** As the vertex shader numbers them; 0 leaves t as it is. */
const BLENDS: Record<Blend, number> = { quartic: 0, cubic: 1, quintic: 2, cosine: 3 };
const RADIANS = Math.PI / 180;

/** The deformation that the splats add to the server's last frame, in scene coordinates; false where nothing changed. */
export function setResidual(splat: Uniforms, residual: Residual | null, blend: Blend | null): boolean {
  if (!residual && splat["residualKind"]?.value === 0) return false;
  setUniform(splat, "residualBlend", blend ? BLENDS[blend] : 0);
  setUniform(splat, "residualKind", residual ? RESIDUAL_KINDS[residual.kind] : 0);
  const vector = vectorUniform(splat, "residualVector");
  if (residual && "point" in residual) vectorUniform(splat, "residualPoint").set(...residual.point);
  switch (residual?.kind) {
    case "translation":
      vector.set(...residual.vector);
      break;
    case "rotation":
      vector.set(...normalise(residual.direction));
      setUniform(splat, "residualAmount", residual.angleDeg * RADIANS);
      break;
    case "scale":
      vector.set(...residual.to).subScalar(1);
      vectorUniform(splat, "residualFrom")
        .set(...residual.from)
        .subScalar(1);
      break;
    case "twist":
      vector.set(...normalise(residual.direction));
      setUniform(splat, "residualAmount", residual.degPerUnit * RADIANS);
      break;
    case "along_normal":
      setUniform(splat, "residualAmount", residual.distance);
      break;
  }
  return true;
}
