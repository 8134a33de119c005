// The edit of the demonstration, in the dragon's own coordinates (metres, y up, the head toward -x).
//
// The head with its horns, fins and lower jaw is the one-region; belly, legs, arched back and tail are the zero-region; the
// neck between them is free. The arch stands only millimetres behind the neck, and distances to the regions go through the
// air: so the head turns about an axis along the back of the neck, where a small scale parameter does no harm.
const box = (min, max) => ({ type: "box", min, max });

export const zeroOperations = [
  { mode: "add", shape: box([-0.12, 0.05, -0.06], [0.1, 0.088, 0.06]) },
  { mode: "add", shape: { type: "half_space", point: [-0.0268, 0.118, 0], normal: [0.928, -0.373, 0] } },
];

export const oneOperations = [
  box([-0.12, 0.15, -0.06], [-0.0075, 0.2, 0.06]), // the skull
  box([-0.03, 0.168, -0.06], [0.005, 0.2, 0.06]), // the horns
  box([-0.022, 0.147, -0.06], [-0.0105, 0.2, 0.06]), // the fins of the cheeks
  box([-0.12, 0.1365, -0.06], [-0.062, 0.152, 0.06]), // the lower jaw
].map((shape) => ({ mode: "add", shape, steal: true }));

export const turn = (angleDeg) => ({
  level: 0,
  deformation: {
    type: "rotation",
    axis: { point: [-0.028, 0.135, -0.02], direction: [0.25, 0.968, 0] },
    angle_deg: angleDeg,
  },
});

/** How deep a point lies in a shape: positive inside. */
function depth(shape, p) {
  if (shape.type === "box") {
    return Math.min(...p.map((value, i) => Math.min(value - shape.min[i], shape.max[i] - value)));
  }
  const dot = p.reduce((sum, value, i) => sum + (value - shape.point[i]) * shape.normal[i], 0);
  return dot / Math.hypot(...shape.normal);
}

/** "zero", "one", "free", or null where a point lies so close to a shape's border that rounding decides. */
export function regionOf(p, tolerance) {
  const deepest = (operations) => Math.max(...operations.map(({ shape }) => depth(shape, p)));
  const one = deepest(oneOperations);
  if (Math.abs(one) < tolerance) return null;
  if (one > 0) return "one"; // the one-region is painted last, and steals
  const zero = deepest(zeroOperations);
  if (Math.abs(zero) < tolerance) return null;
  return zero > 0 ? "zero" : "free";
}
