/**
 * Splats: every sample is one point sprite, cut by its fragment shader to the disc that stands perpendicular to the
 * sample's normal. The vertex shader reads the frame's arrays as they are: box fractions, octahedral normals, marks.
 */
const DECODE = /* glsl */ `
precision highp float;
precision highp int;
in vec4 position;   // box fractions x y z, then t
in vec2 octahedral;
in vec2 detail;     // snorm detail; stretch as snorm bits
in vec4 color;
in float mark;
in float radius;    // bfloat16 bits; 0 where the frame has none

uniform sampler2D blockTable; // two texels a block: minimum and count, extent
uniform int blockSize;
uniform int blockTableWidth;
uniform float stretchRange;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform float splatRadius;    // world units, for samples that bring no radius of their own
uniform float splatScale;     // of the radii that samples bring
uniform float pixelScale;     // pixels that one world unit spans at depth 1
uniform float maxPointSize;

// The part of the deformation that the hand is ahead of the server: 0 none, 1 translation, 2 rotation, 3 scale, 4 twist,
// 5 along the normal.
uniform int residualKind;
uniform vec3 residualVector;   // translation, unit axis, or factors less 1
uniform vec3 residualPoint;
uniform vec3 residualFrom;     // factors less 1 that the frame shows already
uniform int residualBlend;     // what a quartic t is turned into: 0 nothing else, 1 cubic, 2 quintic, 3 cosine
uniform float residualAmount;  // angle, angle a unit of height, or distance

flat out vec3 vCenter;
flat out vec3 vNormal;
flat out float vRadius;

vec3 decodeNormal(vec2 e) {
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(e.yx)) * vec2(e.x < 0.0 ? -1.0 : 1.0, e.y < 0.0 ? -1.0 : 1.0);
  return normalize(n);
}

vec3 turn(vec3 v, vec3 axis, float angle) {
  float c = cos(angle);
  return v * c + cross(axis, v) * sin(angle) + axis * dot(axis, v) * (1.0 - c);
}

// t as another blend makes it: quartic is (x^2 - 1)^2, which leads back to x.
float reblend(float t) {
  if (residualBlend == 0) return t;
  float x = sqrt(max(0.0, 1.0 - sqrt(t)));
  float y = 1.0 - x;
  if (residualBlend == 1) return y * y * (1.0 + 2.0 * x);
  if (residualBlend == 2) return y * y * y * (1.0 + 3.0 * x + 6.0 * x * x);
  return 0.5 + 0.5 * cos(3.14159265358979 * x);
}

// F(p, t) of what the hand is ahead, and the cofactors of dF/dp on the normal. Answers how far samples move apart.
float deformAhead(float t, inout vec3 p, inout vec3 normal) {
  vec3 from = p - residualPoint;
  if (residualKind == 1) {
    p += t * residualVector;
  } else if (residualKind == 2) {
    p = residualPoint + turn(from, residualVector, t * residualAmount);
    normal = turn(normal, residualVector, t * residualAmount);
  } else if (residualKind == 3) {
    vec3 factors = (1.0 + t * residualVector) / (1.0 + t * residualFrom);
    p = residualPoint + factors * from;
    normal = normalize(normal / factors);
    return max(1.0, max(factors.x, max(factors.y, factors.z)));
  } else if (residualKind == 4) {
    float angle = t * residualAmount * dot(residualVector, from);
    vec3 shear = t * residualAmount * cross(residualVector, from);
    p = residualPoint + turn(from, residualVector, angle);
    normal = normalize(turn(normal - dot(shear, normal) * residualVector, residualVector, angle));
  } else if (residualKind == 5) {
    p += t * residualAmount * normal;
  }
  return 1.0;
}

float decodeStretch(float bits) {
  float v = round(bits * 32767.0);
  return (v < 0.0 ? v + 65536.0 : v) / 65535.0 * stretchRange;
}

// Puts the sprite on screen; false where the slot holds nothing.
bool placeSplat(out vec3 normal) {
  int block = gl_VertexID / blockSize;
  int lane = gl_VertexID - block * blockSize;
  ivec2 at = ivec2((block % (blockTableWidth / 2)) * 2, block / (blockTableWidth / 2));
  vec4 lower = texelFetch(blockTable, at, 0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = 0.0;
  vCenter = vec3(0.0);
  vNormal = vec3(0.0, 0.0, 1.0);
  vRadius = 0.0;
  normal = vec3(0.0, 0.0, 1.0);
  if (float(lane) >= lower.w) return false;
  vec3 p = lower.xyz + texelFetch(blockTable, at + ivec2(1, 0), 0).xyz * position.xyz;
  normal = decodeNormal(octahedral);
  float t = reblend(position.w);
  float spread = deformAhead(t, p, normal);
  vec4 center = viewMatrix * vec4(p, 1.0);
  vec3 n = mat3(viewMatrix) * normal;
  vec3 ray = normalize(center.xyz);
  float facing = dot(n, ray);
  if (facing > 0.0) { n = -n; facing = -facing; }
  // A disc seen from its edge would vanish: it is tipped until a fifth of it shows, so that silhouettes stay closed.
  if (facing > -0.2) n = normalize(n - (0.2 + facing) * 1.05 * ray);
  float stretch = stretchRange > 0.0 ? clamp(decodeStretch(detail.y), 1.0, 4.0) : 1.0;
  vCenter = center.xyz;
  vNormal = n;
  float own = uintBitsToFloat(uint(radius) << 16) * splatScale;
  vRadius = (own > 0.0 ? own : splatRadius) * stretch * spread;
  gl_Position = projectionMatrix * center;
  gl_PointSize = clamp(2.0 * vRadius * pixelScale / max(-center.z, 1e-20) + 1.0, 1.5, maxPointSize);
  return true;
}
`;

/** First pass: which sample is in front, and how far away its surface is. */
export const VISIBILITY_VERTEX = /* glsl */ `${DECODE}
flat out float vSlot;
void main() {
  vec3 normal;
  placeSplat(normal);
  vSlot = float(gl_VertexID + 1);
}
`;

const DISC = /* glsl */ `
precision highp float;
flat in vec3 vCenter;
flat in vec3 vNormal;
flat in float vRadius;
uniform mat4 projectionMatrix;
uniform vec2 viewport;

// Where this pixel's ray meets the disc's plane, in view space; outside of the disc the fragment is none.
vec3 meetDisc(out float off) {
  vec2 ndc = gl_FragCoord.xy / viewport * 2.0 - 1.0;
  vec3 ray = vec3((ndc.x + projectionMatrix[2][0]) / projectionMatrix[0][0],
                  (ndc.y + projectionMatrix[2][1]) / projectionMatrix[1][1], -1.0);
  vec3 hit = ray * (dot(vNormal, vCenter) / dot(vNormal, ray));
  off = length(hit - vCenter) / vRadius;
  // Sprites of a pixel or two have no room for a disc: they stand for their centre.
  float pixels = vRadius * projectionMatrix[1][1] * viewport.y * 0.5 / -vCenter.z;
  if (pixels < 0.75) { hit = vCenter; off = 0.0; }
  return hit;
}
`;

export const VISIBILITY_FRAGMENT = /* glsl */ `${DISC}
flat in float vSlot;
layout(location = 0) out vec4 outSurface; // slot + 1, distance along the view axis
void main() {
  float off;
  vec3 hit = meetDisc(off);
  if (off > 1.0) discard;
  vec4 clip = projectionMatrix * vec4(hit, 1.0);
  gl_FragDepth = clamp(clip.z / clip.w * 0.5 + 0.5, 0.0, 1.0);
  outSurface = vec4(vSlot, -hit.z, 0.0, 1.0);
}
`;

/** Second pass: albedo and normal of all the splats that make up the front surface, weighted by their distance. */
export const ATTRIBUTE_VERTEX = /* glsl */ `${DECODE}
uniform int mode;         // 0 clay, 1 colour, 2 normals, 3 t, 4 detail, 5 stretch
uniform bool tintRegions;
uniform sampler2D colormap;
uniform vec3 clay;
uniform vec3 zeroColor;
uniform vec3 oneColor;
flat out vec3 vAlbedo;

vec3 toLinear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }

void main() {
  vec3 normal;
  vAlbedo = vec3(0.0);
  if (!placeSplat(normal)) return;
  vec3 albedo = clay;
  if (mode == 1) albedo = toLinear(color.rgb);
  else if (mode == 2) albedo = toLinear(normal * 0.5 + 0.5);
  else if (mode == 3) albedo = toLinear(texture(colormap, vec2(position.w, 0.5)).rgb);
  else if (mode == 4) albedo = toLinear(texture(colormap, vec2(detail.x * 0.5 + 0.5, 0.5)).rgb);
  else if (mode == 5) {
    // Each doubling takes half of the map: 1 to 4.
    float doublings = stretchRange > 0.0 ? log2(clamp(decodeStretch(detail.y), 1.0, 4.0)) : 0.0;
    albedo = toLinear(texture(colormap, vec2(0.5 * doublings, 0.5)).rgb);
  }
  if (tintRegions && mode < 2) {
    if (mark > 1.5) albedo = mix(albedo, oneColor, 0.86);
    else if (mark > 0.5) albedo = mix(albedo, zeroColor, 0.86);
  }
  vAlbedo = albedo;
  // Tested against the first pass's depth where the disc could at most be in front: what is wholly hidden ends here.
  vec4 nearest = projectionMatrix * vec4(vCenter.xy, vCenter.z + 1.75 * vRadius, 1.0);
  gl_Position.z = nearest.w > 0.0 ? max(nearest.z / nearest.w, -1.0) * gl_Position.w : -gl_Position.w;
}
`;

export const ATTRIBUTE_FRAGMENT = /* glsl */ `${DISC}
flat in vec3 vAlbedo;
uniform sampler2D surface;
layout(location = 0) out vec4 outAlbedo;
layout(location = 1) out vec4 outNormal;
void main() {
  float off;
  vec3 hit = meetDisc(off);
  if (off > 1.0) discard;
  float front = texelFetch(surface, ivec2(gl_FragCoord.xy), 0).g;
  if (-hit.z > front + 0.75 * vRadius) discard;
  float weight = exp(-3.0 * off * off);
  outAlbedo = vec4(vAlbedo * weight, weight);
  outNormal = vec4(vNormal * weight, weight);
}
`;
