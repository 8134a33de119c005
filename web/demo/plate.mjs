// Plates for the figures: samples of a square plane on a jittered lattice, with colours and texture coordinates.

/** SplitMix64: the same numbers on every machine. */
function randomNumbers(seed) {
  let state = BigInt(seed);
  return () => {
    state = BigInt.asUintN(64, state + 0x9e3779b97f4a7c15n);
    let z = state;
    z = BigInt.asUintN(64, (z ^ (z >> 30n)) * 0xbf58476d1ce4e5b9n);
    z = BigInt.asUintN(64, (z ^ (z >> 27n)) * 0x94d049bb133111ebn);
    return Number((z ^ (z >> 31n)) >> 11n) / 2 ** 53;
  };
}

/** A checkerboard of `fields` squares a side, in two soft colours. */
export const checkerboard = (fields) => (u, v) =>
  (Math.floor(u * fields) + Math.floor(v * fields)) % 2 === 0 ? [236, 228, 210] : [120, 62, 58];

/**
 * A binary PLY file of side x side samples of [-1, 1]^2, z = height(x, y), coloured by colour(u, v), with texture
 * coordinates u, v in [0, 1] and normals of the height field.
 */
export function plate(side, { height = () => 0, colour = () => [200, 200, 200] } = {}) {
  const names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"];
  const header = [
    "ply",
    "format binary_little_endian 1.0",
    `element vertex ${side * side}`,
    ...names.map((name) => `property float ${name}`),
    ...["red", "green", "blue"].map((name) => `property uchar ${name}`),
    "end_header\n",
  ].join("\n");
  const stride = 4 * names.length + 3;
  const bytes = Buffer.alloc(header.length + side * side * stride);
  bytes.write(header, "latin1");
  const random = randomNumbers(5);
  let offset = header.length;
  for (let i = 0; i < side * side; i++) {
    const at = (k) => (k + 0.5 + 0.6 * (random() - 0.5)) / side;
    const [u, v] = [at(i % side), at(Math.floor(i / side))];
    const [x, y] = [2 * u - 1, 2 * v - 1];
    const h = 1e-4;
    const slope = [height(x + h, y) - height(x - h, y), height(x, y + h) - height(x, y - h)];
    const normal = [-slope[0] / (2 * h), -slope[1] / (2 * h), 1];
    const length = Math.hypot(...normal);
    for (const value of [x, y, height(x, y), ...normal.map((n) => n / length), u, v]) {
      bytes.writeFloatLE(value, offset);
      offset += 4;
    }
    for (const value of colour(u, v)) bytes.writeUInt8(value, offset++);
  }
  return bytes;
}
