import { add, distance, scale, type Vec3 } from "../math/vec3";

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

  add(p: Vec3, weight: number): void {
    this.sum_[0] += p[0] * weight;
    this.sum_[1] += p[1] * weight;
    this.sum_[2] += p[2] * weight;
    this.weight_ += weight;
  }

  get value(): Vec3 | null {
    if (this.weight_ <= 0) return null;
    return [this.sum_[0] / this.weight_, this.sum_[1] / this.weight_, this.sum_[2] / this.weight_];
  }
}

/** Calls `visit` with every sample's position, mark and t. */
function forEachSample(slots: SlotArrays, visit: (p: Vec3, mark: number, t: number) => void): void {
  const { positions, marks, table, blockSize, blockCount } = slots;
  for (let block = 0; block < blockCount; ++block) {
    const at = block * 8;
    const count = table[at + 3] ?? 0;
    for (let lane = 0; lane < count; ++lane) {
      const slot = block * blockSize + lane;
      const axis = (k: 0 | 1 | 2): number =>
        (table[at + k] ?? 0) + ((table[at + 4 + k] ?? 0) * (positions[4 * slot + k] ?? 0)) / 65535;
      visit([axis(0), axis(1), axis(2)], marks?.[slot] ?? 0, (positions[4 * slot + 3] ?? 0) / 65535);
    }
  }
}

/** Centres of the regions and of the transition between them; asked once when a gizmo appears. */
export function regionCentres(slots: SlotArrays): RegionCentres {
  const zero = new Mean();
  const one = new Mean();
  forEachSample(slots, (p, mark) => {
    if (mark === 1) zero.add(p, 1);
    if (mark === 2) one.add(p, 1);
  });
  if (!zero.value || !one.value) return { zero: zero.value, one: one.value, boundary: null };
  // Far from both regions t is near one half as well: only what lies between their centres counts.
  const middle = scale(add(zero.value, one.value), 0.5);
  const spread = 0.35 * distance(zero.value, one.value);
  const boundary = new Mean();
  forEachSample(slots, (p, mark, t) => {
    if (mark !== 0 || t <= 0 || t >= 1) return;
    boundary.add(p, (4 * t * (1 - t)) ** 4 * Math.exp(-0.5 * (distance(p, middle) / spread) ** 2));
  });
  return { zero: zero.value, one: one.value, boundary: boundary.value };
}
