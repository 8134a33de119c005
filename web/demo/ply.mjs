// Reads the vertices of a binary little-endian PLY file: just what the demonstration needs to check a download.
// biome-ignore format: a table
const readers = {
  char: ["getInt8", 1], int8: ["getInt8", 1], uchar: ["getUint8", 1], uint8: ["getUint8", 1],
  short: ["getInt16", 2], int16: ["getInt16", 2], ushort: ["getUint16", 2], uint16: ["getUint16", 2],
  int: ["getInt32", 4], int32: ["getInt32", 4], uint: ["getUint32", 4], uint32: ["getUint32", 4],
  float: ["getFloat32", 4], float32: ["getFloat32", 4], double: ["getFloat64", 8], float64: ["getFloat64", 8],
};

/** Where the vertices of a file stand: {count, stride, columns, view}. */
export function openPly(bytes) {
  const end = "end_header\n";
  const headerLength =
    Buffer.from(bytes.buffer, bytes.byteOffset, Math.min(bytes.length, 65536)).indexOf(end) + end.length;
  if (headerLength < end.length) throw new Error("not a PLY file: no end of the header");
  const lines = Buffer.from(bytes.buffer, bytes.byteOffset, headerLength).toString("latin1").split("\n");
  if (lines[0] !== "ply" || lines[1] !== "format binary_little_endian 1.0")
    throw new Error(`not a binary PLY file: ${lines[1]}`);
  const elements = lines.filter((line) => line.startsWith("element "));
  const [, name, countText] = elements[0]?.split(" ") ?? [];
  if (name !== "vertex") throw new Error("the PLY file does not start with its vertices");
  const count = Number(countText);

  const columns = new Map();
  let stride = 0;
  for (const line of lines.slice(lines.indexOf(elements[0]) + 1)) {
    if (!line.startsWith("property ")) break;
    const [, type, property] = line.split(" ");
    const reader = readers[type];
    if (!reader) throw new Error(`a PLY property of type ${type}`);
    columns.set(property, { read: reader[0], offset: stride, width: reader[1] });
    stride += reader[1];
  }
  if (bytes.length < headerLength + count * stride) throw new Error("the PLY file is cut short");

  const view = new DataView(bytes.buffer, bytes.byteOffset + headerLength);
  return { count, stride, columns, view };
}

/** Answers {count, positions: Float64Array(3 * count)}: float32 coordinates are exact in it. */
export function readPly(bytes) {
  const { count, stride, columns, view } = openPly(bytes);
  const xyz = ["x", "y", "z"].map((property) => columns.get(property));
  if (xyz.includes(undefined)) throw new Error("the PLY file has no x, y, z");
  const positions = new Float64Array(3 * count);
  for (let i = 0; i < count; i++) {
    for (let axis = 0; axis < 3; axis++)
      positions[3 * i + axis] = view[xyz[axis].read](i * stride + xyz[axis].offset, true);
  }
  return { count, positions };
}
