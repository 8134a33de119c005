/**
 * Sample by sample: what the viewer's hot path never does. Positions and normals of single lanes for picking and framing,
 * and an encoder for tests and mock servers.
 */
import {
  blockHeaderBytes,
  blockRecordBytes,
  type Frame,
  type FrameBlock,
  type FrameHeader,
  frameAttributes,
  frameHeaderBytes,
  frameVersion,
} from "./frames";

/** The position of a lane relative to the frame's origin. */
export function lanePosition(block: FrameBlock, lane: number): [number, number, number] {
  const axis = (index: 0 | 1 | 2): number =>
    block.minimum[index] + (block.extent[index] * (block.positionT[4 * lane + index] ?? 0)) / 65535;
  return [axis(0), axis(1), axis(2)];
}

/** t of a lane, in 0..1. */
export function laneT(block: FrameBlock, lane: number): number {
  return (block.positionT[4 * lane + 3] ?? 0) / 65535;
}

/** The unit normal of a lane; null where the frame has none. */
export function laneNormal(block: FrameBlock, lane: number): [number, number, number] | null {
  if (!block.normal) return null;
  const u = Math.max(-1, (block.normal[2 * lane] ?? 0) / 32767);
  const v = Math.max(-1, (block.normal[2 * lane + 1] ?? 0) / 32767);
  let [x, y] = [u, v];
  const z = 1 - Math.abs(u) - Math.abs(v);
  if (z < 0) {
    x = (1 - Math.abs(v)) * (u < 0 ? -1 : 1);
    y = (1 - Math.abs(u)) * (v < 0 ? -1 : 1);
  }
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

/** Signed detail of a lane in model units; 0 where the frame has none. */
export function laneDetail(header: FrameHeader, block: FrameBlock, lane: number): number {
  const raw = block.detailStretch?.[2 * lane] ?? 0;
  return (((raw << 16) >> 16) / 32767) * header.detailRange;
}

/** Stretch of a lane; 0 where the frame has none. */
export function laneStretch(header: FrameHeader, block: FrameBlock, lane: number): number {
  return ((block.detailStretch?.[2 * lane + 1] ?? 0) / 65535) * header.stretchRange;
}

/** Radius of a lane's splat in model units; 0 where the frame has none. */
export function laneRadius(block: FrameBlock, lane: number): number {
  return new Float32Array(new Uint32Array([(block.radius?.[lane] ?? 0) << 16]).buffer)[0] ?? 0;
}

/** The bytes of a frame. The columns are taken as they are: nothing is checked, so that tests can make bad frames. */
export function encodeFrame(frame: Frame): Uint8Array<ArrayBuffer> {
  const { header, blocks } = frame;
  let length = frameHeaderBytes;
  for (const block of blocks) length += blockRecordBytes(block.count, header.attributes);
  const bytes = new Uint8Array(length);
  writeHeader(new DataView(bytes.buffer), header, length);
  let offset = frameHeaderBytes;
  for (const block of blocks) {
    writeBlock(bytes, offset, block, header.attributes);
    offset += blockRecordBytes(block.count, header.attributes);
  }
  return bytes;
}

function writeHeader(view: DataView, header: FrameHeader, length: number): void {
  view.setUint32(0, 0x52465750, true);
  view.setUint16(4, frameVersion, true);
  view.setUint16(6, frameHeaderBytes, true);
  view.setUint32(8, length, true);
  view.setUint8(12, header.kind === "key" ? 0 : 1);
  view.setUint8(13, header.level);
  view.setUint16(14, header.attributes, true);
  view.setBigUint64(16, BigInt(header.revision), true);
  view.setBigUint64(24, BigInt(header.sequence), true);
  view.setUint32(32, header.sampleCount, true);
  view.setUint32(36, header.blockSize, true);
  view.setUint32(40, header.blockCount, true);
  view.setUint32(44, header.presentBlocks, true);
  header.origin.forEach((value, axis) => {
    view.setFloat64(48 + 8 * axis, value, true);
  });
  view.setFloat32(72, header.detailRange, true);
  view.setFloat32(76, header.stretchRange, true);
  [...header.bounds.center, header.bounds.radius].forEach((value, i) => {
    view.setFloat32(80 + 4 * i, value, true);
  });
}

function writeBlock(
  bytes: Uint8Array<ArrayBuffer>,
  offset: number,
  block: FrameBlock,
  attributes: number,
): void {
  const view = new DataView(bytes.buffer);
  view.setUint32(offset, block.number, true);
  view.setUint32(offset + 4, block.count, true);
  [...block.minimum, ...block.extent].forEach((value, i) => {
    view.setFloat32(offset + 8 + 4 * i, value, true);
  });
  let at = offset + blockHeaderBytes;
  const put = (column: ArrayBufferView | null, length: number): void => {
    if (column) bytes.set(new Uint8Array(column.buffer, column.byteOffset, column.byteLength), at);
    at += length;
  };
  put(block.positionT, 8 * block.count);
  if (attributes & frameAttributes.normal) put(block.normal, 4 * block.count);
  if (attributes & frameAttributes.detail) put(block.detailStretch, 4 * block.count);
  if (attributes & frameAttributes.color) put(block.color, 4 * block.count);
  if (attributes & frameAttributes.marks) put(block.marks, (block.count + 3) & ~3);
  if (attributes & frameAttributes.ids) put(block.ids, 4 * block.count);
  if (attributes & frameAttributes.radius) put(block.radius, (2 * block.count + 3) & ~3);
}

/** The bytes of one stream record. */
export function encodeStreamRecord(type: number, payload: Uint8Array): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(8 + payload.length);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, type, true);
  view.setUint32(4, payload.length, true);
  bytes.set(payload, 8);
  return bytes;
}
