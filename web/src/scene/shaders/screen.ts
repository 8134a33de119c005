/** Passes over the whole picture: lighting, accumulation, the stroke's mask, and what is laid over at the end. */
export const SCREEN_VERTEX = /* glsl */ `
in vec3 position;
out vec2 vUv;
void main() {
  vUv = position.xy * 0.5 + 0.5;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}
`;

/** Lighting in view space, eye-dome lighting and ambient occlusion from the distances, and the background. */
export const SHADE_FRAGMENT = /* glsl */ `
precision highp float;
in vec2 vUv;
uniform sampler2D surface;
uniform sampler2D albedo;
uniform sampler2D normals;
uniform vec2 viewport;
uniform mat4 projectionMatrix;
uniform mat4 viewMatrix;
uniform float pixelRatio;
uniform float edl;          // strength; 0 switches it off
uniform float dataMode;     // 1 where colours carry numbers and must stay readable
uniform float objectRadius;
uniform float turn;         // of the occlusion pattern, another one in every accumulated picture
uniform float blend;
uniform bool flatBackground;
layout(location = 0) out vec4 outColor;

const vec3 KEY = vec3(-0.463, 0.617, 0.636);
const vec3 FILL = vec3(0.77, -0.06, 0.635);
const vec3 RIM = vec3(0.25, 0.55, -0.797);

float depthAt(vec2 pixel) {
  return texelFetch(surface, ivec2(clamp(pixel, vec2(0.0), viewport - 1.0)), 0).g;
}

vec3 viewAt(vec2 pixel, float depth) {
  vec2 ndc = pixel / viewport * 2.0 - 1.0;
  return vec3((ndc.x + projectionMatrix[2][0]) / projectionMatrix[0][0] * depth,
              (ndc.y + projectionMatrix[2][1]) / projectionMatrix[1][1] * depth, -depth);
}

const vec2 DOME[8] = vec2[8](vec2(1.0, 0.0), vec2(0.707, 0.707), vec2(0.0, 1.0), vec2(-0.707, 0.707),
                             vec2(-1.0, 0.0), vec2(-0.707, -0.707), vec2(0.0, -1.0), vec2(0.707, -0.707));

float eyeDome(vec2 pixel, float depth, mat2 spin) {
  float sum = 0.0;
  float step = 1.4 * pixelRatio;
  float own = log2(depth);
  for (int i = 0; i < 8; ++i) {
    float other = depthAt(pixel + step * (spin * DOME[i]));
    if (other > 0.0) sum += max(0.0, own - log2(other));
  }
  // Depths differ more between pixels the further away the object is: measured in parts of its size.
  return exp(-edl * sum * depth / objectRadius * 14.0);
}

// A spiral of ten places that covers the disc evenly.
const vec2 SPIRAL[10] = vec2[10](vec2(0.224, 0.0), vec2(-0.286, 0.262), vec2(0.044, -0.498), vec2(0.360, 0.470),
                                 vec2(-0.661, -0.117), vec2(0.626, -0.398), vec2(-0.209, 0.779), vec2(-0.381, -0.777),
                                 vec2(0.840, 0.379), vec2(-0.880, 0.428));

float occlusion(vec2 pixel, vec3 at, vec3 n, mat2 spin) {
  float reach = 0.085 * objectRadius;
  float pixels = clamp(reach * projectionMatrix[1][1] * viewport.y * 0.5 / -at.z, 4.0, 90.0 * pixelRatio);
  float sum = 0.0;
  for (int i = 0; i < 10; ++i) {
    vec2 place = pixel + pixels * (spin * SPIRAL[i]);
    float other = depthAt(place);
    if (other <= 0.0) continue;
    vec3 to = viewAt(place, other) - at;
    float size = length(to);
    sum += max(0.0, dot(n, to) / max(size, 1e-12) - 0.12) * smoothstep(2.2 * reach, 0.3 * reach, size);
  }
  return clamp(1.0 - 2.3 * sum / 10.0, 0.0, 1.0);
}

vec3 background(vec2 uv) {
  if (flatBackground) return vec3(1.0);
  vec2 off = (uv - vec2(0.5, 0.56)) * vec2(viewport.x / viewport.y, 1.0);
  float fall = smoothstep(0.0, 1.05, length(off));
  return mix(vec3(0.0222, 0.0262, 0.0331), vec3(0.0055, 0.0066, 0.0090), fall);
}

void main() {
  vec2 pixel = gl_FragCoord.xy;
  vec4 a = texelFetch(albedo, ivec2(pixel), 0);
  float depth = depthAt(pixel);
  vec3 color = background(vUv);
  if (a.a > 0.0 && depth > 0.0) {
    vec3 base = a.rgb / a.a;
    vec3 n = normalize(texelFetch(normals, ivec2(pixel), 0).xyz);
    vec3 at = viewAt(pixel, depth);
    vec3 eye = normalize(-at);
    mat2 spin = mat2(cos(turn), sin(turn), -sin(turn), cos(turn));
    float open = edl > 0.0 ? occlusion(pixel, at, n, spin) : 1.0;
    vec3 up = normalize(mat3(viewMatrix) * vec3(0.0, 1.0, 0.0));
    float sky = dot(n, up) * 0.5 + 0.5;
    vec3 ambient = mix(vec3(0.085, 0.078, 0.075), vec3(0.225, 0.248, 0.285), sky) * open;
    float key = max(0.0, dot(n, KEY));
    float fill = max(0.0, dot(n, FILL));
    float edge = pow(1.0 - max(0.0, dot(n, eye)), 3.0);
    float rim = edge * max(0.0, dot(n, RIM) + 0.55);
    vec3 light = ambient + vec3(1.06, 1.0, 0.91) * key * mix(0.62, 1.0, open) + vec3(0.15, 0.19, 0.25) * fill;
    float shine = pow(max(0.0, dot(n, normalize(KEY + eye))), 34.0) * 0.085;
    vec3 lit = base * light + (vec3(0.30, 0.36, 0.44) * rim * 0.36 + shine) * open;
    vec3 plain = base * (0.42 + 0.58 * mix(max(0.0, dot(n, eye)), key, 0.35)) * mix(0.7, 1.0, open);
    color = mix(lit, plain, dataMode);
    if (edl > 0.0) color *= mix(eyeDome(pixel, depth, spin), 1.0, 0.18);
  }
  outColor = vec4(color, blend);
}
`;

/** Draws one segment of the stroke into the mask: pixels whose surface lies within the radius of the segment. */
export const MASK_FRAGMENT = /* glsl */ `
precision highp float;
in vec2 vUv;
uniform sampler2D surface;
uniform vec2 viewport;
uniform mat4 projectionMatrix;
uniform vec3 from;  // view space
uniform vec3 to;
uniform float radius;
layout(location = 0) out vec4 outMask;
void main() {
  float depth = texelFetch(surface, ivec2(gl_FragCoord.xy), 0).g;
  if (depth <= 0.0) discard;
  vec2 ndc = gl_FragCoord.xy / viewport * 2.0 - 1.0;
  vec3 at = vec3((ndc.x + projectionMatrix[2][0]) / projectionMatrix[0][0] * depth,
                 (ndc.y + projectionMatrix[2][1]) / projectionMatrix[1][1] * depth, -depth);
  vec3 along = to - from;
  float square = dot(along, along);
  float f = square > 0.0 ? clamp(dot(at - from, along) / square, 0.0, 1.0) : 0.0;
  if (distance(at, from + f * along) > radius) discard;
  outMask = vec4(1.0);
}
`;

/** The picture to the screen, with the stroke's tint and the brush's ring on the surface. */
export const PRESENT_FRAGMENT = /* glsl */ `
precision highp float;
in vec2 vUv;
uniform sampler2D picture;
uniform sampler2D surface;
uniform sampler2D mask;
uniform vec2 viewport;
uniform mat4 projectionMatrix;
uniform float pixelRatio;
uniform bool showMask;
uniform vec3 maskColor;
uniform bool showRing;
uniform vec3 ringCenter;  // view space
uniform float ringRadius;
uniform vec3 ringColor;
layout(location = 0) out vec4 outColor;

vec3 toSrgb(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

// A soft shoulder: leaves the lower three quarters alone and keeps highlights from clipping.
vec3 shoulder(vec3 c) {
  vec3 over = max(c - 0.75, 0.0);
  return min(c, 0.75) + over / (1.0 + over * 2.4);
}

float noise(vec2 p) { return fract(52.9829189 * fract(dot(p, vec2(0.06711056, 0.00583715)))); }

void main() {
  vec3 color = toSrgb(shoulder(texture(picture, vUv).rgb));
  float depth = texelFetch(surface, ivec2(gl_FragCoord.xy), 0).g;
  if (depth > 0.0) {
    if (showMask && texelFetch(mask, ivec2(gl_FragCoord.xy), 0).r > 0.5) {
      float light = dot(color, vec3(0.35, 0.45, 0.2));
      color = mix(color, maskColor * (0.35 + 1.0 * light), 0.86);
    }
    if (showRing) {
      vec2 ndc = gl_FragCoord.xy / viewport * 2.0 - 1.0;
      vec3 at = vec3((ndc.x + projectionMatrix[2][0]) / projectionMatrix[0][0] * depth,
                     (ndc.y + projectionMatrix[2][1]) / projectionMatrix[1][1] * depth, -depth);
      float pixel = depth * 2.0 / (projectionMatrix[1][1] * viewport.y) * pixelRatio;
      float off = distance(at, ringCenter);
      float line = 1.0 - smoothstep(0.7, 1.7, abs(off - ringRadius) / pixel);
      color = mix(color, ringColor, 0.12 * step(off, ringRadius));
      color = mix(color, mix(ringColor, vec3(1.0), 0.55), line * 0.95);
    }
  }
  color += (noise(gl_FragCoord.xy) - 0.5) / 255.0;
  outColor = vec4(color, 1.0);
}
`;
