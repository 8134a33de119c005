import {
  type BufferAttribute,
  BufferGeometry,
  DataTexture,
  FloatType,
  GLBufferAttribute,
  NearestFilter,
  RGBAFormat,
  Sphere,
} from "three";
import { type LayerPrefix, layerPrefixes } from "./layers";
import type { StagedSurface } from "./surface-stage";

/** What the surface needs to know of a frame before its blocks come. */
export interface SurfaceLayout {
  sampleCount: number;
  blockSize: number;
  blockCount: number;
  /** Of the attribute bits of FRAMES.md. */
  hasNormals: boolean;
  hasDetail: boolean;
  hasColor: boolean;
  hasMarks: boolean;
  hasRadius: boolean;
  /** Of the frame's stretches; 0 where it has none. */
  stretchRange: number;
}

/** One block as the frame carries it: the arrays are uploaded as they are. */
export interface SurfaceBlock {
  index: number;
  count: number;
  minimum: ArrayLike<number>;
  extent: ArrayLike<number>;
  positions: ArrayBufferView;
  normals: ArrayBufferView | null;
  detail: ArrayBufferView | null;
  color: ArrayBufferView | null;
  marks: ArrayBufferView | null;
  radius: ArrayBufferView | null;
}

type Field = "positions" | "normals" | "detail" | "color" | "marks" | "radius";

interface FieldFormat {
  attribute: string;
  components: number;
  bytes: number;
  type: "UNSIGNED_SHORT" | "SHORT" | "UNSIGNED_BYTE";
  normalised: boolean;
}

const FORMATS: Record<Field, FieldFormat> = {
  positions: { attribute: "position", components: 4, bytes: 8, type: "UNSIGNED_SHORT", normalised: true },
  normals: { attribute: "octahedral", components: 2, bytes: 4, type: "SHORT", normalised: true },
  detail: { attribute: "detail", components: 2, bytes: 4, type: "SHORT", normalised: true },
  color: { attribute: "color", components: 4, bytes: 4, type: "UNSIGNED_BYTE", normalised: true },
  marks: { attribute: "mark", components: 1, bytes: 1, type: "UNSIGNED_BYTE", normalised: false },
  radius: { attribute: "radius", components: 1, bytes: 2, type: "UNSIGNED_SHORT", normalised: false },
};

const BLOCKS_PER_ROW = 256;

/**
 * The samples on the GPU: one buffer an attribute, where a block's place follows from its number, and a table texture with
 * each block's quantisation box and count. Blocks that have not come have count 0 and are culled by the vertex shader.
 */
export class SampleSurface implements StagedSurface {
  readonly geometry = new BufferGeometry();
  readonly blockTable: DataTexture;
  readonly room: number;
  loadedSamples = 0;

  private layout_: SurfaceLayout;
  private prefixes_: LayerPrefix[];
  private readonly gl_: WebGL2RenderingContext;
  private readonly buffers_ = new Map<Field, WebGLBuffer>();
  private readonly table_: Float32Array;

  /** For frames of this layout, or of others of the same attributes and up to `room` blocks. */
  constructor(gl: WebGL2RenderingContext, layout: SurfaceLayout, room: number) {
    this.gl_ = gl;
    this.layout_ = layout;
    this.prefixes_ = layerPrefixes(layout.sampleCount, layout.blockSize, layout.blockCount);
    this.room = Math.max(room, layout.blockCount);
    const rows = Math.max(1, Math.ceil(this.room / BLOCKS_PER_ROW));
    this.table_ = new Float32Array(rows * BLOCKS_PER_ROW * 8);
    this.blockTable = new DataTexture(this.table_, BLOCKS_PER_ROW * 2, rows, RGBAFormat, FloatType);
    this.blockTable.minFilter = NearestFilter;
    this.blockTable.magFilter = NearestFilter;
    this.blockTable.needsUpdate = true;
    // Never asked for the samples' own bounds: they are on the GPU, and nothing is culled by them.
    this.geometry.boundingSphere = new Sphere();
    this.allocate("positions");
    if (layout.hasNormals) this.allocate("normals");
    if (layout.hasDetail) this.allocate("detail");
    if (layout.hasColor) this.allocate("color");
    if (layout.hasMarks) this.allocate("marks");
    if (layout.hasRadius) this.allocate("radius");
  }

  get blockTableWidth(): number {
    return BLOCKS_PER_ROW * 2;
  }

  get capacity(): number {
    return this.room * this.layout_.blockSize;
  }

  get layout(): SurfaceLayout {
    return this.layout_;
  }

  get prefixes(): readonly LayerPrefix[] {
    return this.prefixes_;
  }

  begin(layout: SurfaceLayout): boolean {
    const { blockCount: _, sampleCount: __, stretchRange: ___, ...have } = this.layout_;
    const same = (Object.keys(have) as (keyof typeof have)[]).every((key) => have[key] === layout[key]);
    if (!same || layout.blockCount > this.room) return false;
    this.layout_ = layout;
    this.prefixes_ = layerPrefixes(layout.sampleCount, layout.blockSize, layout.blockCount);
    this.loadedSamples = 0;
    this.table_.fill(0);
    this.blockTable.needsUpdate = true;
    return true;
  }

  /** Uploads one block: one bufferSubData an attribute, and two texels of the table. */
  put(block: SurfaceBlock): void {
    const slot = block.index * this.layout_.blockSize;
    this.upload("positions", slot, block.positions);
    this.upload("normals", slot, block.normals);
    this.upload("detail", slot, block.detail);
    this.upload("color", slot, block.color);
    this.upload("marks", slot, block.marks);
    this.upload("radius", slot, block.radius);
    const at = block.index * 8;
    this.loadedSamples += block.count - (this.table_[at + 3] ?? 0);
    for (let axis = 0; axis < 3; ++axis) {
      this.table_[at + axis] = block.minimum[axis] ?? 0;
      this.table_[at + 4 + axis] = block.extent[axis] ?? 0;
    }
    this.table_[at + 3] = block.count;
    this.blockTable.needsUpdate = true;
  }

  /** Reads the samples back for a look at the whole; not for every frame. Null where the GPU gives nothing back. */
  readBack(): { positions: Uint16Array; marks: Uint8Array | null; table: Float32Array } {
    const positions = new Uint16Array(this.capacity * 4);
    this.readBuffer("positions", positions);
    const marks = this.layout_.hasMarks ? new Uint8Array(this.capacity) : null;
    if (marks) this.readBuffer("marks", marks);
    return { positions, marks, table: this.table_ };
  }

  dispose(): void {
    for (const buffer of this.buffers_.values()) this.gl_.deleteBuffer(buffer);
    this.buffers_.clear();
    this.geometry.dispose();
    this.blockTable.dispose();
  }

  private allocate(field: Field): void {
    const gl = this.gl_;
    const format = FORMATS[field];
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.capacity * format.bytes, gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    this.buffers_.set(field, buffer);
    const elementSize = format.bytes / format.components;
    const attribute = new GLBufferAttribute(
      buffer,
      gl[format.type],
      format.components,
      elementSize as 1 | 2 | 4,
      this.capacity,
      format.normalised,
    );
    // The typings of setAttribute leave out what its renderer takes.
    this.geometry.setAttribute(format.attribute, attribute as unknown as BufferAttribute);
  }

  private upload(field: Field, slot: number, data: ArrayBufferView | null): void {
    const buffer = this.buffers_.get(field);
    if (!buffer || !data) return;
    const gl = this.gl_;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, slot * FORMATS[field].bytes, data);
  }

  private readBuffer(field: Field, into: ArrayBufferView): void {
    const buffer = this.buffers_.get(field);
    if (!buffer) return;
    const gl = this.gl_;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.getBufferSubData(gl.ARRAY_BUFFER, 0, into);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }
}
