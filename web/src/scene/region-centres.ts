import type { Vec3 } from "../math/vec3";

/** Slots as SampleSurface reads them back. */
export interface SlotArrays {
  positions: Uint16Array;
  marks: Uint8Array | null;
  /** Eight floats a block: minimum, count, extent, unused. */
  table: Float32Array;
  blockSize: number;
  blockCount: number;
}

export interface RegionCentres {
  zero: Vec3 | null;
  one: Vec3 | null;
  /** The middle of the transition between the regions: where t is near one half. */
  boundary: Vec3 | null;
}

class Mean {
  private sum_: [number, number, number] = [0, 0, 0];
  private weight_ = 0;

  add(x: number, y: number, z: number, weight: number): void {
    this.sum_[0] += x * weight;
    this.sum_[1] += y * weight;
    this.sum_[2] += z * weight;
    this.weight_ += weight;
  }

  get value(): Vec3 | null {
    if (this.weight_ <= 0) return null;
    return [this.sum_[0] / this.weight_, this.sum_[1] / this.weight_, this.sum_[2] / this.weight_];
  }
}

/** Centres of the regions and of the transition between them; asked once when a gizmo appears. */
export function regionCentres(slots: SlotArrays): RegionCentres {
  const zero = new Mean();
  const one = new Mean();
  const boundary = new Mean();
  const { positions, marks, table, blockSize, blockCount } = slots;
  for (let block = 0; block < blockCount; ++block) {
    const at = block * 8;
    const count = table[at + 3] ?? 0;
    for (let lane = 0; lane < count; ++lane) {
      const slot = block * blockSize + lane;
      const x = (table[at] ?? 0) + ((table[at + 4] ?? 0) * (positions[4 * slot] ?? 0)) / 65535;
      const y = (table[at + 1] ?? 0) + ((table[at + 5] ?? 0) * (positions[4 * slot + 1] ?? 0)) / 65535;
      const z = (table[at + 2] ?? 0) + ((table[at + 6] ?? 0) * (positions[4 * slot + 2] ?? 0)) / 65535;
      const mark = marks?.[slot] ?? 0;
      if (mark === 1) zero.add(x, y, z, 1);
      if (mark === 2) one.add(x, y, z, 1);
      const t = (positions[4 * slot + 3] ?? 0) / 65535;
      if (mark === 0 && t > 0 && t < 1) boundary.add(x, y, z, (4 * t * (1 - t)) ** 4);
    }
  }
  return { zero: zero.value, one: one.value, boundary: boundary.value };
}
