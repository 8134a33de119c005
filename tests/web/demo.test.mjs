// The demonstration's own arithmetic: what it says about an edit is only as good as this.
import assert from "node:assert/strict";
import { test } from "node:test";
import { oneOperations, regionOf, zeroOperations } from "../../web/demo/dragon.mjs";
import { readPly } from "../../web/demo/ply.mjs";
import { fitRigidMotion } from "../../web/demo/rigid.mjs";

const count = 500;
/** Points of a deterministic sequence in a box. */
const scattered = Float64Array.from(
  { length: 3 * count },
  (_, i) => ((i * 0.618033988749895) % 1) * (1 + (i % 3)),
);
const everyIndex = Array.from({ length: count }, (_, i) => i);

function turned(points, angle, offset) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const result = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 3) {
    const [x, y, z] = points.subarray(i, i + 3);
    result.set([c * x + s * z + offset[0], y + offset[1], c * z - s * x + offset[2]], i);
  }
  return result;
}

test("a rigid motion is found with its angle and axis", () => {
  for (const degrees of [0.5, 40, 90, 179]) {
    const motion = fitRigidMotion(
      scattered,
      turned(scattered, (degrees * Math.PI) / 180, [3, -2, 1]),
      everyIndex,
    );
    assert.ok(Math.abs(motion.angleDeg - degrees) < 1e-9, `${motion.angleDeg} instead of ${degrees}`);
    assert.ok(Math.abs(motion.axis[1] - 1) < 1e-9);
    assert.ok(motion.max < 1e-12);
  }
});

test("a motion that is not rigid shows in the residuals", () => {
  const bent = turned(scattered, 0.7, [0, 0, 0]);
  bent[0] += 0.1;
  const motion = fitRigidMotion(scattered, bent, everyIndex);
  assert.ok(motion.max > 0.09 && motion.max < 0.1);
});

test("only the asked points count", () => {
  const moved = scattered.slice();
  moved[3] += 5;
  const motion = fitRigidMotion(scattered, moved, [0, 2, 3, 4, 5, 6]);
  assert.ok(motion.angleDeg < 1e-6 && motion.max < 1e-12);
});

test("vertices of a binary PLY file are read with their types, whatever stands between them", () => {
  const header =
    "ply\nformat binary_little_endian 1.0\ncomment made by a test\nelement vertex 2\nproperty uchar red\n" +
    "property double x\nproperty float y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n";
  const body = Buffer.alloc(2 * 17);
  [
    [1, 0.1, 2.5, -3],
    [2, 1e-300, -0.25, 8],
  ].forEach(([red, x, y, z], i) => {
    body.writeUInt8(red, 17 * i);
    body.writeDoubleLE(x, 17 * i + 1);
    body.writeFloatLE(y, 17 * i + 9);
    body.writeFloatLE(z, 17 * i + 13);
  });
  const ply = readPly(Buffer.concat([Buffer.from(header, "latin1"), body]));
  assert.equal(ply.count, 2);
  assert.deepEqual([...ply.positions], [0.1, 2.5, -3, 1e-300, -0.25, 8]);
  assert.throws(
    () => readPly(Buffer.concat([Buffer.from(header, "latin1"), body.subarray(0, 33)])),
    /cut short/,
  );
  assert.throws(() => readPly(Buffer.from("solid nothing\n")), /not a PLY file/);
});

test("the dragon's regions are where its parts are, and borders are left undecided", () => {
  const tolerance = 1e-6;
  assert.equal(regionOf([-0.08, 0.17, 0], tolerance), "one"); // the snout
  assert.equal(regionOf([0, 0.06, 0.02], tolerance), "zero"); // a foot
  assert.equal(regionOf([0.02, 0.15, -0.02], tolerance), "zero"); // the arched back
  assert.equal(regionOf([-0.045, 0.12, -0.02], tolerance), "free"); // the neck
  assert.equal(regionOf([-0.05, 0.15 + 1e-7, 0], tolerance), null);
  assert.ok(oneOperations.every(({ steal }) => steal));
  assert.ok(zeroOperations.every(({ mode }) => mode === "add"));
});
