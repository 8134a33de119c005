/**
 * Sample frames (protocol/FRAMES.md): a strict decoder that hands out typed-array views, ready for GPU upload, and never
 * touches a sample in JavaScript.
 */

export const frameVersion = 1;
export const frameHeaderBytes = 96;
export const blockHeaderBytes = 32;
export const maxBlockSize = 65536;

/** Bits of a frame's attributes; positions are always there. */
export const frameAttributes = {
  normal: 1,
  t: 2,
  detail: 4,
  color: 8,
  marks: 16,
  ids: 32,
  radius: 64,
} as const;
export type FrameAttribute = keyof typeof frameAttributes;
const allAttributes = 127;

export type FrameKind = "key" | "delta";

export interface FrameHeader {
  kind: FrameKind;
  level: number;
  /** Bits of `frameAttributes`. */
  attributes: number;
  revision: number;
  /** The preview's number, as its sender gave it; 0 where no preview is shown. */
  sequence: number;
  sampleCount: number;
  blockSize: number;
  blockCount: number;
  presentBlocks: number;
  origin: [number, number, number];
  detailRange: number;
  stretchRange: number;
  /** A ball around the surface, relative to the origin. */
  bounds: { center: [number, number, number]; radius: number };
}

/** One block record: views into the frame's bytes. What the attributes do not name is null. */
export interface FrameBlock {
  number: number;
  count: number;
  minimum: [number, number, number];
  extent: [number, number, number];
  /** 4 per sample: x y z as fractions of the box, then t; all of 65535. */
  positionT: Uint16Array;
  /** 2 per sample: octahedral, snorm of 32767. */
  normal: Int16Array | null;
  /** 2 per sample: detail (as int16, snorm of the detail range), then stretch (unorm of the stretch range). */
  detailStretch: Uint16Array | null;
  /** 4 per sample: RGBA. */
  color: Uint8Array | null;
  /** 1 zero-region, 2 one-region. */
  marks: Uint8Array | null;
  ids: Uint32Array | null;
  /** Of the splats at rest, as bfloat16; in key frames only. */
  radius: Uint16Array | null;
}

export interface Frame {
  header: FrameHeader;
  /** In the order of the frame. */
  blocks: FrameBlock[];
}

export interface FrameLimits {
  maxSamples: number;
}
const defaultLimits: FrameLimits = { maxSamples: 100_000_000 };

/** Bytes that are not a frame: too few, too many, or contradicting themselves. */
export class FrameError extends Error {
  override readonly name = "FrameError";
}

/** Whether the header's attributes name this one. */
export function hasAttribute(header: FrameHeader, attribute: FrameAttribute): boolean {
  return (header.attributes & frameAttributes[attribute]) !== 0;
}

/** Bytes of one block record with `count` filled lanes. */
export function blockRecordBytes(count: number, attributes: number): number {
  let bytes = blockHeaderBytes + 8 * count;
  for (const name of ["normal", "detail", "color", "ids"] as const) {
    if (attributes & frameAttributes[name]) bytes += 4 * count;
  }
  if (attributes & frameAttributes.marks) bytes += paddedToWord(count);
  if (attributes & frameAttributes.radius) bytes += paddedToWord(2 * count);
  return bytes;
}

/**
 * Reads one frame; throws a FrameError where FRAMES.md has it refused. The views share the buffer of `bytes`, unless it
 * begins at an odd place, where it is copied once.
 */
export function decodeFrame(bytes: Uint8Array, limits: FrameLimits = defaultLimits): Frame {
  const aligned = bytes.byteOffset % 4 === 0 ? bytes : bytes.slice();
  const view = new DataView(aligned.buffer, aligned.byteOffset, aligned.byteLength);
  const header = readHeader(view);
  checkHeader(header, view.byteLength, limits);

  const blocks: FrameBlock[] = [];
  const seen = new Set<number>();
  let samples = 0;
  let offset = frameHeaderBytes;
  let previous = -1;
  for (let i = 0; i < header.presentBlocks; ++i) {
    const block = readBlock(aligned, view, offset, header);
    if (header.kind === "key") {
      refuse(seen.has(block.number), "a block that was there before");
      seen.add(block.number);
    } else {
      refuse(block.number <= previous, "blocks that do not ascend");
      previous = block.number;
    }
    samples += block.count;
    offset += blockRecordBytes(block.count, header.attributes);
    blocks.push(block);
  }
  refuse(offset !== view.byteLength, "more bytes than the blocks fill");
  const contradicted = header.kind === "key" ? samples !== header.sampleCount : samples > header.sampleCount;
  refuse(contradicted, "a sample count that the blocks contradict");
  return { header, blocks };
}

function refuse(wrong: boolean, what: string): void {
  if (wrong) throw new FrameError(`not a frame: ${what}`);
}

function paddedToWord(bytes: number): number {
  return (bytes + 3) & ~3;
}

function readNumber(view: DataView, offset: number, what: string): number {
  const value = view.getBigUint64(offset, true);
  refuse(value > BigInt(Number.MAX_SAFE_INTEGER), `a ${what} beyond 2^53 - 1`);
  return Number(value);
}

/** The header of a frame whose bytes may be still on their way: `view` has the frame's whole length. */
export function readHeader(view: DataView): FrameHeader {
  refuse(view.byteLength < frameHeaderBytes, "shorter than the header");
  refuse(view.getUint32(0, true) !== 0x52465750, "another magic than PWFR");
  refuse(view.getUint16(4, true) !== frameVersion, "an unknown version");
  refuse(view.getUint16(6, true) !== frameHeaderBytes, "another header size than 96");
  refuse(view.getUint32(8, true) !== view.byteLength, "another length than announced");
  const kind = view.getUint8(12);
  refuse(kind > 1, "an unknown kind");
  const attributes = view.getUint16(14, true);
  refuse((attributes & ~allAttributes) !== 0, "unknown attribute bits");
  refuse(kind === 1 && (attributes & frameAttributes.radius) !== 0, "radii in a delta");
  return {
    kind: kind === 0 ? "key" : "delta",
    level: view.getUint8(13),
    attributes,
    revision: readNumber(view, 16, "revision"),
    sequence: readNumber(view, 24, "sequence"),
    sampleCount: view.getUint32(32, true),
    blockSize: view.getUint32(36, true),
    blockCount: view.getUint32(40, true),
    presentBlocks: view.getUint32(44, true),
    origin: [view.getFloat64(48, true), view.getFloat64(56, true), view.getFloat64(64, true)],
    detailRange: view.getFloat32(72, true),
    stretchRange: view.getFloat32(76, true),
    bounds: { center: readVector(view, 80), radius: view.getFloat32(92, true) },
  };
}

function readVector(view: DataView, offset: number): [number, number, number] {
  return [
    view.getFloat32(offset, true),
    view.getFloat32(offset + 4, true),
    view.getFloat32(offset + 8, true),
  ];
}

function isFinitePositive(value: number): boolean {
  return Number.isFinite(value) && value >= 0;
}

/** Throws a FrameError where the header contradicts itself or the frame's length. */
export function checkHeader(header: FrameHeader, length: number, limits: FrameLimits = defaultLimits): void {
  refuse(header.sampleCount > limits.maxSamples, `${header.sampleCount} samples, beyond the limit`);
  refuse(header.blockSize < 1 || header.blockSize > maxBlockSize, "a block size out of range");
  refuse(header.blockCount > header.sampleCount, "more blocks than samples");
  refuse(header.blockCount * header.blockSize < header.sampleCount, "more samples than slots");
  refuse(header.presentBlocks > header.blockCount, "more blocks present than there are");
  const whole = header.presentBlocks === header.blockCount;
  refuse(header.kind === "key" && !whole, "a key frame without all blocks");
  const least = blockRecordBytes(1, header.attributes);
  refuse((length - frameHeaderBytes) / least < header.presentBlocks, "more blocks than bytes");
  refuse(!header.origin.every(Number.isFinite), "an origin that is not finite");
  refuse(!isFinitePositive(header.detailRange), "a detail range that is not a length");
  refuse(!isFinitePositive(header.stretchRange), "a stretch range that is not a factor");
  const { center, radius } = header.bounds;
  refuse(!center.every(Number.isFinite) || !isFinitePositive(radius), "bounds that are not a ball");
}

/** The block record at `offset`, which must have come whole. */
export function readBlock(
  bytes: Uint8Array,
  view: DataView,
  offset: number,
  header: FrameHeader,
): FrameBlock {
  refuse(view.byteLength - offset < blockHeaderBytes, "a block record is cut off");
  const number = view.getUint32(offset, true);
  const count = view.getUint32(offset + 4, true);
  refuse(number >= header.blockCount, "a block number out of range");
  refuse(count < 1 || count > header.blockSize, "a lane count out of range");
  refuse(view.byteLength - offset < blockRecordBytes(count, header.attributes), "a block record is cut off");
  const minimum = readVector(view, offset + 8);
  const extent = readVector(view, offset + 20);
  for (let axis = 0; axis < 3; ++axis) {
    const low = minimum[axis] ?? Number.NaN;
    const size = extent[axis] ?? Number.NaN;
    const sound = Number.isFinite(low) && isFinitePositive(size) && Number.isFinite(Math.fround(low + size));
    refuse(!sound, "a quantisation box that is not finite or negative");
  }

  let at = bytes.byteOffset + offset + blockHeaderBytes;
  const take = (bytesTaken: number): number => {
    const start = at;
    at += bytesTaken;
    return start;
  };
  const has = (attribute: FrameAttribute): boolean => hasAttribute(header, attribute);
  const buffer = bytes.buffer;
  const positionT = new Uint16Array(buffer, take(8 * count), 4 * count);
  const normal = has("normal") ? new Int16Array(buffer, take(4 * count), 2 * count) : null;
  const detailStretch = has("detail") ? new Uint16Array(buffer, take(4 * count), 2 * count) : null;
  const color = has("color") ? new Uint8Array(buffer, take(4 * count), 4 * count) : null;
  const skipPadding = (bytesTaken: number): void => {
    const padding = paddedToWord(bytesTaken) - bytesTaken;
    const zero = new Uint8Array(buffer, take(padding), padding).every((value) => value === 0);
    refuse(!zero, "padding that is not zero");
  };
  const marks = has("marks") ? new Uint8Array(buffer, take(count), count) : null;
  if (marks) skipPadding(count);
  const ids = has("ids") ? new Uint32Array(buffer, take(4 * count), count) : null;
  const radius = has("radius") ? new Uint16Array(buffer, take(2 * count), count) : null;
  if (radius) {
    skipPadding(2 * count);
    // From 0x7f80 on: infinities, what is not a number, and everything with a sign. -0 alone is a length.
    const sound = radius.every((bits) => bits < 0x7f80 || bits === 0x8000);
    refuse(!sound, "a radius that is not a length");
  }
  return { number, count, minimum, extent, positionT, normal, detailStretch, color, marks, ids, radius };
}
