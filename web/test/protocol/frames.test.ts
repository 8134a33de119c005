import { describe, expect, it } from "vitest";
import {
  encodeFrame,
  laneDetail,
  laneNormal,
  lanePosition,
  laneRadius,
  laneStretch,
  laneT,
} from "../../src/protocol/frame-tools";
import {
  blockRecordBytes,
  decodeFrame,
  type FrameBlock,
  FrameError,
  type FrameHeader,
} from "../../src/protocol/frames";
import { goldenBytes, goldenJson } from "./golden";

interface ExpectedBlock
  extends Omit<FrameBlock, "positionT" | "normal" | "detailStretch" | "color" | "marks" | "ids" | "radius"> {
  positionT: number[];
  normal: number[];
  detailStretch: number[];
  color: number[];
  marks: number[];
  ids: number[];
  radius: number[];
  /** Model space, 3 per sample, as C++ decodes them. */
  positions: number[];
  normals: number[];
}
interface ExpectedFrame {
  file: string;
  header: FrameHeader;
  blocks: ExpectedBlock[];
}
interface MalformedFrame {
  name: string;
  file: string;
  cut?: number;
  append?: number;
  offset?: number;
  bytes?: number[];
}

const vectors = goldenJson<ExpectedFrame[]>("vectors/vectors.json");

function entry(array: ArrayLike<number>, index: number): number {
  return array[index] ?? Number.NaN;
}

describe.each(vectors)("the golden frame $file", ({ file, header, blocks }) => {
  const frame = decodeFrame(goldenBytes(`vectors/${file}`));

  it("has the header that C++ wrote", () => {
    expect(frame.header).toEqual(header);
  });

  it("has the blocks and columns that C++ reads", () => {
    expect(frame.blocks.map((block) => block.number)).toEqual(blocks.map((block) => block.number));
    frame.blocks.forEach((block, i) => {
      const expected = blocks[i] as ExpectedBlock;
      expect(block.count).toBe(expected.count);
      expect(block.minimum).toEqual(expected.minimum);
      expect(block.extent).toEqual(expected.extent);
      for (const column of [
        "positionT",
        "normal",
        "detailStretch",
        "color",
        "marks",
        "ids",
        "radius",
      ] as const) {
        expect(Array.from(block[column] ?? [])).toEqual(expected[column]);
      }
    });
  });

  it("decodes to the positions and normals of C++", () => {
    frame.blocks.forEach((block, i) => {
      const expected = blocks[i] as ExpectedBlock;
      for (let lane = 0; lane < block.count; ++lane) {
        const position = lanePosition(block, lane);
        const normal = laneNormal(block, lane);
        expect(normal === null).toBe(block.normal === null);
        for (let axis = 0; axis < 3; ++axis) {
          const model = entry(frame.header.origin, axis) + entry(position, axis);
          expect(model).toBeCloseTo(entry(expected.positions, 3 * lane + axis), 8);
          if (normal) expect(entry(normal, axis)).toBeCloseTo(entry(expected.normals, 3 * lane + axis), 6);
        }
        expect(laneT(block, lane)).toBeGreaterThanOrEqual(0);
        expect(laneT(block, lane)).toBeLessThanOrEqual(1);
        expect(Math.abs(laneDetail(frame.header, block, lane))).toBeLessThanOrEqual(frame.header.detailRange);
        expect(laneRadius(block, lane)).toBeGreaterThanOrEqual(0);
        expect(laneStretch(frame.header, block, lane)).toBeLessThanOrEqual(frame.header.stretchRange);
      }
    });
  });

  it("is encoded again to the same bytes", () => {
    expect(encodeFrame(frame)).toEqual(goldenBytes(`vectors/${file}`));
  });
});

describe("the decoder", () => {
  const key = goldenBytes("vectors/key.frame");
  const delta = goldenBytes("vectors/delta.frame");

  it("hands out views of the frame's own bytes, without a copy", () => {
    const frame = decodeFrame(key);
    for (const block of frame.blocks) {
      for (const view of [
        block.positionT,
        block.normal,
        block.detailStretch,
        block.color,
        block.marks,
        block.ids,
        block.radius,
      ]) {
        expect(view?.buffer).toBe(key.buffer);
      }
    }
  });

  it("reads a frame that begins at an odd byte of a larger buffer", () => {
    for (const shift of [1, 2, 3, 4]) {
      const larger = new Uint8Array(key.length + shift + 9);
      larger.set(key, shift);
      const frame = decodeFrame(larger.subarray(shift, shift + key.length));
      expect(frame.header).toEqual(decodeFrame(key).header);
      expect(encodeFrame(frame)).toEqual(key);
    }
  });

  it.each(goldenJson<MalformedFrame[]>("vectors/malformed.json"))("refuses $name", (malformed) => {
    const whole = goldenBytes(`vectors/${malformed.file}`);
    const bytes = new Uint8Array(malformed.cut ?? whole.length + (malformed.append ?? 0));
    bytes.set(whole.subarray(0, bytes.length));
    if (malformed.offset !== undefined) bytes.set(malformed.bytes ?? [], malformed.offset);
    expect(() => decodeFrame(bytes)).toThrow(FrameError);
  });

  it("refuses every truncation, also where the announced length is corrected", () => {
    for (const whole of [key, delta]) {
      for (let length = 0; length < whole.length; ++length) {
        const cut = whole.slice(0, length);
        expect(() => decodeFrame(cut)).toThrow(FrameError);
        if (length < 12) continue;
        new DataView(cut.buffer).setUint32(8, length, true);
        expect(() => decodeFrame(cut)).toThrow(FrameError);
      }
    }
  });

  it("answers mutants with a frame or a FrameError, nothing else", () => {
    let seed = 7;
    const random = (range: number): number => {
      seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
      return (seed >>> 8) % range;
    };
    let accepted = 0;
    for (let round = 0; round < 5000; ++round) {
      const mutant = delta.slice();
      for (let change = 0; change <= random(3); ++change) {
        mutant[random(random(4) === 0 ? mutant.length : 128)] = random(256);
      }
      try {
        const frame = decodeFrame(mutant);
        for (const block of frame.blocks) expect(block.positionT.length).toBe(4 * block.count);
        ++accepted;
      } catch (error) {
        expect(error).toBeInstanceOf(FrameError);
      }
    }
    expect(accepted).toBeGreaterThan(0);
  });

  it("keeps the limit on samples", () => {
    expect(() => decodeFrame(key, { maxSamples: 149 })).toThrow(FrameError);
    expect(decodeFrame(key, { maxSamples: 150 }).header.sampleCount).toBe(150);
  });

  it("knows the size of records", () => {
    expect(blockRecordBytes(1, 0)).toBe(40);
    expect(blockRecordBytes(3, 16)).toBe(32 + 24 + 4);
    expect(blockRecordBytes(3, 64)).toBe(32 + 24 + 8);
    expect(blockRecordBytes(5, 63)).toBe(32 + 5 * 8 + 4 * 5 * 4 + 8);
  });
});
