/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/shaders.h"

#define VERSION "#version 330 core\n"

/* An instance: place and bevel, quaternion w x y z, extent and gloss, colour. */
#define INSTANCE                                                           \
  "layout(location=0) in vec3 normal;\n"                                   \
  "layout(location=1) in vec3 offset;\n"                                   \
  "layout(location=2) in vec4 place;\n"                                    \
  "layout(location=3) in vec4 turn;\n"                                     \
  "layout(location=4) in vec4 extent;\n"                                   \
  "layout(location=5) in vec4 colour;\n"                                   \
  "vec3 turned(vec3 v) {\n"                                                \
  "  vec3 t = 2.0 * cross(turn.yzw, v);\n"                                 \
  "  return v + turn.x * t + cross(turn.yzw, t);\n"                        \
  "}\n"                                                                    \
  "vec3 world() {\n"                                                       \
  "  return place.xyz + turned(normal * place.w + offset * extent.xyz);\n" \
  "}\n"

/* Light of a clear sky above a bright floor, and of a sun; what a screen shows of it. */
#define LIGHT                                                                          \
  "uniform vec3 sun;\n"                                                                \
  "uniform vec3 eye;\n"                                                                \
  "uniform sampler2DShadow shadow;\n"                                                  \
  "uniform mat4 sun_map;\n"                                                            \
  "uniform float texel;\n"                                                             \
  "vec3 sky(vec3 d) {\n"                                                               \
  "  float h = clamp(d.z, -1.0, 1.0);\n"                                               \
  "  vec3 horizon = vec3(0.80, 0.84, 0.88);\n"                                         \
  "  vec3 up = mix(horizon, vec3(0.20, 0.34, 0.56), sqrt(max(h, 0.0)));\n"             \
  "  return mix(up, vec3(0.62, 0.60, 0.57), smoothstep(0.0, 0.25, -h));\n"             \
  "}\n"                                                                                \
  "vec3 backdrop(vec3 d) {\n"                                                          \
  "  vec3 high = sky(vec3(d.xy, max(d.z, 0.0)));\n"                                    \
  "  return mix(high, vec3(0.46, 0.52, 0.60), smoothstep(0.05, 0.75, -d.z));\n"        \
  "}\n"                                                                                \
  "float lit(vec3 p, vec3 n) {\n"                                                      \
  "  vec4 c = sun_map * vec4(p + n * texel * 1.5, 1.0);\n"                             \
  "  vec3 s = c.xyz * 0.5 + 0.5;\n"                                                    \
  "  if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;\n" \
  "  vec2 t = 1.0 / vec2(textureSize(shadow, 0));\n"                                   \
  "  vec4 o = vec4(0.9, 0.4, -0.4, 0.9) * t.xyxy;\n"                                   \
  "  float z = s.z - 0.0006;\n"                                                        \
  "  return 0.25 * (texture(shadow, vec3(s.xy + o.xy, z)) +\n"                         \
  "                 texture(shadow, vec3(s.xy - o.xy, z)) +\n"                         \
  "                 texture(shadow, vec3(s.xy + o.zw, z)) +\n"                         \
  "                 texture(shadow, vec3(s.xy - o.zw, z)));\n"                         \
  "}\n"                                                                                \
  "vec3 shown(vec3 c) {\n"                                                             \
  "  c = c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);\n"                    \
  "  vec3 a = sqrt(clamp(c, 0.0, 1.0));\n"                                             \
  "  vec3 b = sqrt(a);\n" /* the curve of sRGB by roots, which cost less */            \
  "  return 0.662 * a + 0.6841 * b - 0.3236 * sqrt(b) - 0.02254 * a * a;\n"            \
  "}\n"

const char shader_body_vertex[] = VERSION INSTANCE
    "uniform mat4 camera;\n"
    "out vec3 at;\nout vec3 facing;\nout vec4 paint;\nout float gloss;\n"
    "void main() {\n"
    "  at = world();\n"
    "  facing = turned(normal);\n"
    "  paint = colour;\n"
    "  gloss = extent.w;\n"
    "  gl_Position = camera * vec4(at, 1.0);\n"
    "}\n";

/* gloss: 0 matt .. 1 polished; -1: it shines by itself; -2: a floor. */
const char shader_body_pixel[] = VERSION LIGHT
    "in vec3 at;\nin vec3 facing;\nin vec4 paint;\nin float gloss;\n"
    "uniform vec4 ground;\n" /* middle of the scene, and its size */
    "uniform float cell;\n"
    "out vec4 result;\n"
    "float lines(vec2 p, float wide) {\n"
    "  vec2 f = max(fwidth(p), 1e-6);\n"
    "  vec2 d = abs(fract(p - 0.5) - 0.5);\n"
    "  vec2 l = (1.0 - smoothstep(vec2(wide), wide + f * 1.2, d)) * clamp(0.35 / f, 0.0, 1.0);\n"
    "  return max(l.x, l.y);\n"
    "}\n"
    "void main() {\n"
    "  vec3 n = normalize(facing);\n"
    "  vec3 v = normalize(eye - at);\n"
    "  vec3 base = paint.rgb;\n"
    "  float far = 0.0;\n"
    "  float polish = gloss;\n"
    "  if (gloss < -1.5) {\n"
    "    vec3 m = abs(n);\n"
    "    vec2 p = (m.z > 0.7 ? at.xy : m.x > m.y ? at.yz : at.xz) / cell;\n"
    "    vec2 f = fwidth(p);\n"
    "    float calm = clamp(1.2 - max(f.x, f.y) * 2.0, 0.0, 1.0);\n"
    "    vec2 c = floor(p / 5.0);\n"
    "    float odd = mod(c.x + c.y, 2.0);\n"
    "    base *= 1.0 - 0.10 * odd * clamp(1.2 - max(f.x, f.y) * 0.4, 0.0, 1.0);\n"
    "    base *= 1.0 - 0.16 * lines(p, 0.008) * calm - 0.22 * lines(p / 5.0, 0.004);\n"
    "    far = smoothstep(1.8, 10.0, length(at - ground.xyz) / ground.w);\n"
    "    polish = 0.12;\n"
    "  } else if (gloss < -0.5) {\n"
    "    float shade = 0.72 + 0.28 * dot(n, sun);\n"
    "    result = vec4(shown(base * shade * 1.15), paint.a);\n"
    "    return;\n"
    "  }\n"
    "  float s = lit(at, n);\n"
    "  float d = max(dot(n, sun), 0.0) * s;\n"
    "  float up = 0.5 + 0.5 * n.z;\n"
    "  vec3 around = mix(vec3(0.30, 0.28, 0.26), vec3(0.50, 0.56, 0.66), up);\n"
    "  vec3 h = normalize(sun + v);\n"
    "  float power = exp2(4.0 + 6.0 * polish);\n"
    "  float side = 1.0 - max(dot(n, v), 0.0);\n"
    "  float fresnel = 0.04 + 0.5 * polish * side * side * side * side * side;\n"
    "  vec3 c = base * (around * (0.62 + 0.10 * s) + vec3(1.55, 1.46, 1.32) * d * 0.72);\n"
    "  c += (power + 8.0) / 30.0 * pow(max(dot(n, h), 0.0), power) * d * fresnel * 1.2;\n"
    "  c += sky(reflect(-v, n)) * fresnel * (0.25 + 0.75 * polish) * (0.5 + 0.5 * s);\n"
    "  c = mix(c, backdrop(-v), far);\n"
    "  result = vec4(shown(c), paint.a);\n"
    "}\n";

const char shader_shadow_vertex[] = VERSION INSTANCE
    "uniform mat4 camera;\n"
    "void main() { gl_Position = camera * vec4(world(), 1.0); }\n";

const char shader_shadow_pixel[] = VERSION "void main() {}\n";

const char shader_sky_vertex[] = VERSION
    "uniform mat4 back;\n" /* from the picture to directions */
    "out vec3 way;\n"
    "void main() {\n"
    "  vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;\n"
    "  vec4 w = back * vec4(p, 1.0, 1.0);\n"
    "  way = w.xyz / w.w;\n"
    "  gl_Position = vec4(p, 1.0, 1.0);\n"
    "}\n";

const char shader_sky_pixel[] = VERSION LIGHT
    "in vec3 way;\nout vec4 result;\n"
    "void main() {\n"
    "  vec3 d = normalize(way);\n"
    "  result = vec4(shown(backdrop(d)), 1.0);\n"
    "}\n";

/* A stroke with round ends, or a rectangle with round corners; its edge is smooth by itself. */
const char shader_ink_vertex[] = VERSION
    "layout(location=0) in vec4 ends;\n"
    "layout(location=1) in vec4 colour;\n"
    "layout(location=2) in vec2 how;\n" /* radius, px; 1: a rectangle */
    "uniform vec2 size;\n"
    "out vec2 at;\nflat out vec4 line;\nflat out vec4 paint;\nflat out vec2 kind;\n"
    "void main() {\n"
    "  vec2 low = min(ends.xy, ends.zw) - 1.5 - (how.y > 0.5 ? 0.0 : how.x);\n"
    "  vec2 high = max(ends.xy, ends.zw) + 1.5 + (how.y > 0.5 ? 0.0 : how.x);\n"
    "  at = mix(low, high, vec2(gl_VertexID & 1, gl_VertexID >> 1));\n"
    "  line = ends;\n  paint = colour;\n  kind = how;\n"
    "  gl_Position = vec4(at / size * vec2(2.0, -2.0) + vec2(-1.0, 1.0), 0.0, 1.0);\n"
    "}\n";

const char shader_ink_pixel[] = VERSION
    "in vec2 at;\nflat in vec4 line;\nflat in vec4 paint;\nflat in vec2 kind;\n"
    "out vec4 result;\n"
    "void main() {\n"
    "  float d;\n"
    "  if (kind.y > 0.5) {\n"
    "    vec2 half_size = 0.5 * abs(line.zw - line.xy) - kind.x;\n"
    "    vec2 q = abs(at - 0.5 * (line.xy + line.zw)) - half_size;\n"
    "    d = length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - kind.x;\n"
    "  } else {\n"
    "    vec2 along = line.zw - line.xy;\n"
    "    float length2 = max(dot(along, along), 1e-6);\n"
    "    float share = clamp(dot(at - line.xy, along) / length2, 0.0, 1.0);\n"
    "    d = length(at - line.xy - share * along) - kind.x;\n"
    "  }\n"
    "  result = vec4(paint.rgb, paint.a * clamp(0.5 - d, 0.0, 1.0));\n"
    "}\n";
