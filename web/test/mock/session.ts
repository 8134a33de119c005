import type {
  Deformation,
  EditRecord,
  RegionName,
  RegionOperation,
  ScreenShape,
  SessionDocument,
  Shape,
} from "../../src/api/types";
import { distance, distanceToSegment, dot, length, subtract, type Vec3 } from "../../src/math/vec3";
import { encodeFrame } from "../../src/protocol/frame-tools";
import { type FrameBlock, type FrameHeader, frameAttributes } from "../../src/protocol/frames";
import { layerSizes } from "../../src/scene/layers";
import { deform } from "./deform";
import type { MockShape } from "./shapes";

const BLOCK = 4096;

/** A stand-in for a session of the daemon: the contract's shape with a simple field for t. For tests and development only. */
export class MockSession {
  readonly edits: EditRecord[] = [];
  readonly operations: Record<RegionName, RegionOperation[]> = { zero: [], one: [] };
  head = 0;
  revision = 1;
  readonly marks: Uint8Array;
  private readonly shape_: MockShape;
  private readonly order_: Uint32Array;
  private readonly lower_: Vec3;
  private readonly upper_: Vec3;
  private readonly t_: Float32Array;
  readonly origin: Vec3;

  constructor(
    readonly id: string,
    readonly name: string,
    shape: MockShape,
  ) {
    this.shape_ = shape;
    this.marks = new Uint8Array(shape.count);
    this.t_ = new Float32Array(shape.count);
    const low: [number, number, number] = [Infinity, Infinity, Infinity];
    const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < 3 * shape.count; ++i) {
      const axis = (i % 3) as 0 | 1 | 2;
      low[axis] = Math.min(low[axis], shape.positions[i] ?? 0);
      high[axis] = Math.max(high[axis], shape.positions[i] ?? 0);
    }
    this.lower_ = low;
    this.upper_ = high;
    this.origin = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
    this.order_ = slotOrder(shape);
  }

  private position(i: number): Vec3 {
    const p = this.shape_.positions;
    return [p[3 * i] ?? 0, p[3 * i + 1] ?? 0, p[3 * i + 2] ?? 0];
  }

  private normal(i: number): Vec3 {
    const n = this.shape_.normals;
    return [n[3 * i] ?? 0, n[3 * i + 1] ?? 0, n[3 * i + 2] ?? 0];
  }

  document(): SessionDocument {
    const diagonal = distance(this.lower_, this.upper_);
    const samples = (mark: number): number => this.marks.reduce((sum, m) => sum + (m === mark ? 1 : 0), 0);
    return {
      id: this.id,
      name: this.name,
      cloud: "mockcloud0000000000001",
      state: "ready",
      progress: { phase: "ready", fraction: 1 },
      revision: this.revision,
      created: new Date(0).toISOString(),
      sample_count: this.shape_.count,
      origin: this.origin,
      bounds: { min: this.lower_, max: this.upper_ },
      diagonal,
      spacing: (diagonal * 1.08) / Math.sqrt(this.shape_.count),
      levels: [
        { level: 0, scale: 0.02 * diagonal },
        { level: 1, scale: 0 },
      ],
      decomposition: [],
      regions: {
        zero: { samples: samples(1), operations: this.operations.zero.length },
        one: { samples: samples(2), operations: this.operations.one.length },
        named: [],
      },
      history: { head: this.head, edits: this.edits.length },
      timings_ms: {},
    };
  }

  paint(region: RegionName, operation: RegionOperation): number {
    const own = region === "zero" ? 1 : 2;
    const members = Array.from(this.marks.keys()).filter((i) => this.marks[i] === own);
    const chosen = this.chosen(operation, members);
    const isMember = new Set(members);
    let changed = 0;
    for (let i = 0; i < this.shape_.count; ++i) {
      const mark = this.marks[i] ?? 0;
      const joins = chosen.has(i);
      let member = isMember.has(i);
      if (operation.mode === "remove") member &&= !joins;
      else if (operation.mode === "intersect") member &&= joins;
      else if (operation.mode === "set" || operation.mode === "invert" || operation.mode === "clear")
        member = joins;
      else if (operation.mode === "shrink") member &&= !joins;
      else member ||= joins;
      const free = mark === 0 || mark === own || operation.steal;
      const next = member && free ? own : mark === own ? 0 : mark;
      if (next !== mark) ++changed;
      this.marks[i] = next;
    }
    this.operations[region].push(operation);
    this.changed();
    return changed;
  }

  /** The samples that an operation is about. */
  private chosen(operation: RegionOperation, members: readonly number[]): Set<number> {
    const all = Array.from(this.marks.keys());
    switch (operation.mode) {
      case "clear":
        return new Set();
      case "invert": {
        const inside = new Set(members);
        return new Set(all.filter((i) => !inside.has(i)));
      }
      case "grow":
      case "shrink": {
        const inside = new Set(members);
        const near = operation.mode === "grow" ? members : all.filter((i) => !inside.has(i));
        const from = operation.mode === "grow" ? all : members;
        return new Set(
          from.filter((i) =>
            near.some((j) => distance(this.position(i), this.position(j)) <= operation.distance),
          ),
        );
      }
      case "flood": {
        const radius = operation.radius ?? Infinity;
        return new Set(all.filter((i) => distance(this.position(i), operation.seed) <= radius));
      }
      default: {
        const { facing, shape } = operation;
        return new Set(
          all.filter(
            (i) => (!facing || dot(facing, this.normal(i)) > 0) && contains(shape, this.position(i)),
          ),
        );
      }
    }
  }

  /** A whole list instead of the one that there is. */
  put(region: RegionName, operations: readonly RegionOperation[]): void {
    this.clear(region);
    for (const operation of operations) this.paint(region, operation);
  }

  clear(region: RegionName): void {
    this.operations[region].length = 0;
    const own = region === "zero" ? 1 : 2;
    for (let i = 0; i < this.marks.length; ++i) if (this.marks[i] === own) this.marks[i] = 0;
    this.changed();
  }

  commit(edit: EditRecord["edit"]): EditRecord {
    this.edits.length = this.head;
    const record: EditRecord = {
      index: this.head + 1,
      edit,
      created: new Date().toISOString(),
      moved_samples: this.marks.length,
      surface_hash: "0".repeat(64),
      zero_samples: 0,
      one_samples: 0,
      inserted: 0,
      removed: 0,
      sample_count: this.marks.length,
    };
    this.edits.push(record);
    this.head += 1;
    this.revision += 1;
    return record;
  }

  private changed(): void {
    this.revision += 1;
    const centre = (own: number): Vec3 | null => {
      const sum = [0, 0, 0];
      let count = 0;
      for (let i = 0; i < this.marks.length; ++i) {
        if (this.marks[i] !== own) continue;
        this.position(i).forEach((value, axis) => {
          sum[axis] = (sum[axis] ?? 0) + value;
        });
        ++count;
      }
      return count ? [(sum[0] ?? 0) / count, (sum[1] ?? 0) / count, (sum[2] ?? 0) / count] : null;
    };
    const zero = centre(1);
    const one = centre(2);
    for (let i = 0; i < this.marks.length; ++i) {
      const d0 = zero ? distance(this.position(i), zero) : 1;
      const d1 = one ? distance(this.position(i), one) : 1;
      const x = Math.min(1, d1 / Math.max(1e-9, d0 + d1 * 0.2));
      this.t_[i] = !zero || !one ? 0 : this.marks[i] === 1 ? 0 : this.marks[i] === 2 ? 1 : (x * x - 1) ** 2;
    }
  }

  /** The whole surface with the committed edits and, on top, a preview. */
  frame(preview: Deformation | null, sequence: number, s = 1): Uint8Array<ArrayBuffer> {
    const deformations = this.edits.slice(0, this.head).map((record) => record.edit.deformation);
    if (preview) deformations.push(preview);
    // The recorded edits one after the other, each over its own part of 0 … 1.
    const part = s * deformations.length;
    if (s < 1) deformations.length = Math.ceil(part);
    const last = deformations.at(-1);
    if (s < 1 && last?.type === "translation") {
      const fraction = part - (deformations.length - 1);
      const vector: Vec3 = [last.vector[0] * fraction, last.vector[1] * fraction, last.vector[2] * fraction];
      deformations[deformations.length - 1] = { type: "translation", vector };
    }
    const { count } = this.shape_;
    const sizes = layerSizes(count);
    const blocks: FrameBlock[] = [];
    let from = 0;
    for (const size of sizes) {
      for (let at = 0; at < size; at += BLOCK) {
        blocks.push(this.block(blocks.length, from + at, Math.min(BLOCK, size - at), deformations));
      }
      from += size;
    }
    const { normal, t, detail, marks } = frameAttributes;
    const header: FrameHeader = {
      kind: "key",
      level: 1,
      attributes: normal | t | detail | marks,
      revision: this.revision,
      sequence,
      sampleCount: count,
      blockSize: BLOCK,
      blockCount: blocks.length,
      presentBlocks: blocks.length,
      origin: [...this.origin],
      detailRange: 0.06,
      stretchRange: 0,
      bounds: { center: [0, 0, 0], radius: distance(this.lower_, this.upper_) / 2 },
    };
    return encodeFrame({ header, blocks });
  }

  private block(
    number: number,
    from: number,
    count: number,
    deformations: readonly Deformation[],
  ): FrameBlock {
    const points: Vec3[] = [];
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let lane = 0; lane < count; ++lane) {
      const i = this.order_[from + lane] ?? 0;
      let p = this.position(i);
      for (const deformation of deformations) p = deform(p, deformation, this.t_[i] ?? 0, this.normal(i));
      p = subtract(p, this.origin);
      points.push(p);
      p.forEach((value, axis) => {
        low[axis] = Math.min(low[axis] ?? 0, value);
        high[axis] = Math.max(high[axis] ?? 0, value);
      });
    }
    const block: FrameBlock = {
      number,
      count,
      minimum: low as [number, number, number],
      extent: low.map((value, axis) => (high[axis] ?? 0) - value) as [number, number, number],
      positionT: new Uint16Array(4 * count),
      normal: new Int16Array(2 * count),
      detailStretch: new Uint16Array(2 * count),
      color: null,
      marks: new Uint8Array(count),
      ids: null,
      radius: null,
    };
    points.forEach((p, lane) => {
      const i = this.order_[from + lane] ?? 0;
      p.forEach((value, axis) => {
        const extent = block.extent[axis] ?? 0;
        block.positionT[4 * lane + axis] =
          extent > 0 ? Math.round((65535 * (value - (block.minimum[axis] ?? 0))) / extent) : 0;
      });
      block.positionT[4 * lane + 3] = Math.round(65535 * (this.t_[i] ?? 0));
      block.normal?.set(octahedral(this.normal(i)), 2 * lane);
      if (block.detailStretch)
        block.detailStretch[2 * lane] = Math.round(((this.shape_.detail[i] ?? 0) / 0.06) * 32767) & 0xffff;
      if (block.marks) block.marks[lane] = this.marks[i] ?? 0;
    });
    return block;
  }
}

/** Samples by layer, and within a layer in an order that goes along the surface. */
function slotOrder(shape: MockShape): Uint32Array {
  const coherent = Array.from({ length: shape.count }, (_, i) => i);
  const key = (i: number): number =>
    [0, 1, 2].reduce(
      (sum, axis) => sum * 64 + Math.floor(((shape.positions[3 * i + axis] ?? 0) + 2) * 16),
      0,
    );
  const keys = coherent.map(key);
  coherent.sort((a, b) => (keys[a] ?? 0) - (keys[b] ?? 0));
  const slots: number[] = [];
  for (let i = 0; i < shape.count; i += 64) slots.push(coherent[i] ?? 0);
  for (let step = 32; step >= 1; step /= 2)
    for (let i = step; i < shape.count; i += 2 * step) slots.push(coherent[i] ?? 0);
  return Uint32Array.from(slots);
}

function contains(shape: Shape, p: Vec3): boolean {
  switch (shape.type) {
    case "all":
      return true;
    case "sphere":
      return distance(p, shape.center) <= shape.radius;
    case "box":
      return p.every((value, axis) => value >= (shape.min[axis] ?? 0) && value <= (shape.max[axis] ?? 0));
    case "half_space":
      return dot(subtract(p, shape.point), shape.normal) >= 0;
    case "stroke":
      return shape.vertices.some(
        (vertex, i) => distanceToSegment(p, vertex, shape.vertices[i + 1] ?? vertex) <= shape.radius,
      );
    case "screen":
      return isOutlined(shape, p);
    case "region":
      return false; // it keeps none
    case "image": {
      if (shape.projection.type !== "planar") return false;
      const { origin, u, v } = shape.projection;
      const from = subtract(p, origin);
      const [x, y] = [dot(from, u) / dot(u, u), dot(from, v) / dot(v, v)];
      // Every image is a dark left half beside a bright right one.
      return x >= 0 && x <= 1 && y >= 0 && y <= 1 && x > 0.5 === (shape.side === "above");
    }
    case "model":
      return length(p) <= shape.thickness;
  }
}

/** The projection and the tests of outlines as the contract has them. */
function isOutlined({ view, outline }: ScreenShape, p: Vec3): boolean {
  const row = (r: number): number =>
    (view[4 * r] ?? 0) * p[0] +
    (view[4 * r + 1] ?? 0) * p[1] +
    (view[4 * r + 2] ?? 0) * p[2] +
    (view[4 * r + 3] ?? 0);
  const w = row(3);
  if (w <= 0) return false;
  const [x, y] = [row(0) / w, row(1) / w];
  if (outline.type === "ellipse")
    return (
      ((x - outline.center[0]) / outline.half_axes[0]) ** 2 +
        ((y - outline.center[1]) / outline.half_axes[1]) ** 2 <=
      1
    );
  const at = (i: number): Vec3 => [...(outline.vertices[i] ?? [0, 0]), 0] as unknown as Vec3;
  const count = outline.vertices.length;
  if (outline.type === "polyline")
    return outline.vertices.some(
      (_, i) => distanceToSegment([x, y, 0], at(i), at(Math.min(i + 1, count - 1))) <= outline.width / 2,
    );
  let inside = false;
  for (let i = 0; i < count; ++i) {
    const [a, b] = [at(i), at((i + 1) % count)];
    if (a[1] > y !== b[1] > y && x < a[0] + ((y - a[1]) / (b[1] - a[1])) * (b[0] - a[0])) inside = !inside;
  }
  return inside;
}

function octahedral(n: Vec3): [number, number] {
  const sum = Math.abs(n[0]) + Math.abs(n[1]) + Math.abs(n[2]) || length(n) || 1;
  let u = n[0] / sum;
  let v = n[1] / sum;
  if (n[2] < 0) [u, v] = [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)];
  return [Math.round(32767 * u), Math.round(32767 * v)];
}
