// A recorded run: bodies, hands and forces over time. Nothing is loaded from elsewhere.
const scene = JSON.parse(document.getElementById("scene").textContent);
const world = document.getElementById("world");
const at = (id) => document.getElementById(id);

function complain(text) {
  at("problem").textContent = text;
  at("problem").hidden = false;
}

// ---- data: columns of 16 bit steps, each the difference to the one before, deflated ----

async function inflate(id) {
  const packed = Uint8Array.from(atob(at(id).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

function columnsRead(bytes) {
  const steps = new DataView(bytes);
  let place = 0;
  return scene.columns.map(([least, step, count]) => {
    if (step === 0) return { fixed: least };
    const values = new Float32Array(count);
    let sum = 0;
    for (let i = 0; i < count; ++i) {
      sum = (sum + steps.getUint16(place, true)) & 0xffff;
      values[i] = least + step * sum;
      place += 2;
    }
    return { values };
  });
}

// ---- vectors, quaternions w x y z, matrices by columns ----

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const norm = (a) => Math.sqrt(dot(a, a));
const unit = (a) => scaled(a, 1 / Math.max(norm(a), 1e-12));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0]];

function turned(q, v) {
  const u = [q[1], q[2], q[3]];
  const t = scaled(cross(u, v), 2);
  return add(add(v, scaled(t, q[0])), cross(u, t));
}

function product(a, b) {
  return [a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
}

// The turn that brings z to a direction.
function turnToward(way) {
  if (way[2] < -0.9999) return [0, 1, 0, 0];
  const q = [1 + way[2], -way[1], way[0], 0];
  const n = Math.hypot(...q);
  return q.map((x) => x / n);
}

function matrixProduct(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; ++c) {
    for (let r = 0; r < 4; ++r) {
      for (let k = 0; k < 4; ++k) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    }
  }
  return out;
}

function lookFrom(eye, target) {
  const back = unit(sub(eye, target));
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
}

// ---- shapes: a vertex is normal x bevel + offset x extent ----

// Eight rounded corners: a sphere, a capsule, a box.
function roundedMesh(parts) {
  const vertices = [], indices = [], turns = [];
  for (let quarter = 0; quarter < 4; ++quarter) {
    for (let i = 0; i <= parts; ++i) turns.push([quarter, (quarter + i / parts) * Math.PI / 2]);
  }
  turns.push([0, 2 * Math.PI]);
  const across = turns.length;
  for (let row = 0; row < 2 * (parts + 1); ++row) {
    const upper = row > parts;
    const rise = ((upper ? row - parts - 1 : row - parts) / parts) * Math.PI / 2;
    for (const [quarter, turn] of turns) {
      vertices.push(Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn),
        Math.sin(rise), quarter === 0 || quarter === 3 ? 1 : -1, quarter < 2 ? 1 : -1,
        upper ? 1 : -1);
    }
  }
  for (let row = 0; row + 1 < 2 * (parts + 1); ++row) {
    for (let i = 0; i + 1 < across; ++i) {
      const a = row * across + i;
      indices.push(a, a + 1, a + across, a + 1, a + across + 1, a + across);
    }
  }
  for (const row of [0, 2 * parts + 1]) { // flat ends
    const [a, b, c, d] = [0, 1, 2, 3].map((quarter) => row * across + quarter * (parts + 1));
    indices.push(...(row > 0 ? [a, b, c, a, c, d] : [a, c, b, a, d, c]));
  }
  return { vertices, indices };
}

// Around z from -1 to 1; top: radius of the upper end.
function roundMesh(top) {
  const parts = 40, vertices = [], indices = [];
  for (let i = 0; i < parts; ++i) {
    const a = vertices.length / 6;
    for (const turn of [i, i + 1].map((n) => 2 * Math.PI * n / parts)) {
      const [c, s] = [Math.cos(turn), Math.sin(turn)];
      vertices.push(c, s, 0, c, s, -1, c, s, 0, top * c, top * s, 1);
      vertices.push(0, 0, -1, c, s, -1, 0, 0, 1, top * c, top * s, 1);
    }
    vertices.push(0, 0, -1, 0, 0, -1, 0, 0, 1, 0, 0, 1);
    indices.push(a, a + 4, a + 1, a + 1, a + 4, a + 5, a + 8, a + 6, a + 2, a + 9, a + 3, a + 7);
  }
  return { vertices, indices };
}

function squareMesh() {
  return { vertices: [-1, -1, 1, -1, 1, 1, -1, 1].flatMap((x, i, all) => i % 2 ? [] :
    [0, 0, 1, x, all[i + 1], 0]), indices: [0, 1, 2, 0, 2, 3] };
}

function triangleMesh(bytes, geom) {
  const corners = new Float32Array(bytes, geom.mesh[0], 3 * geom.mesh[1]);
  const indices = new Uint32Array(bytes, geom.mesh[2], 3 * geom.mesh[3]);
  const vertices = [];
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => [...corners.subarray(3 * indices[i + k],
      3 * indices[i + k] + 3)]);
    const normal = unit(cross(sub(b, a), sub(c, a)));
    vertices.push(...normal, ...a, ...normal, ...b, ...normal, ...c);
  }
  return { vertices, indices: Array.from({ length: indices.length }, (_, i) => i) };
}

// ---- drawing ----

const BODY_VERTEX = `#version 300 es
layout(location = 0) in vec3 normal;
layout(location = 1) in vec3 offset;
uniform vec3 place, extent;
uniform vec4 turn;
uniform float bevel;
uniform mat4 look, sunLook;
out vec3 point, facing;
out vec4 inSun;
vec3 turned(vec3 v) {
  vec3 t = 2.0 * cross(turn.yzw, v);
  return v + turn.x * t + cross(turn.yzw, t);
}
void main() {
  point = place + turned(normal * bevel + offset * extent);
  facing = turned(normal);
  inSun = sunLook * vec4(point, 1.0);
  gl_Position = look * vec4(point, 1.0);
}`;

const BODY_PIXEL = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
in vec3 point, facing;
in vec4 inSun;
uniform vec3 eye, sun, middle;
uniform vec4 colour;
uniform float size, floorGrid;
uniform sampler2DShadow shadow;
out vec4 pixel;
const vec3 haze = vec3(0.74, 0.79, 0.83);
float lit(vec3 n) {
  vec3 p = inSun.xyz * 0.5 + 0.5;
  if (p.x < 0.0 || p.x > 1.0 || p.y < 0.0 || p.y > 1.0 || p.z > 1.0) return 1.0;
  float bias = 0.0012 + 0.003 * (1.0 - max(dot(n, sun), 0.0));
  float sum = 0.0;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      sum += texture(shadow, vec3(p.xy + vec2(x, y) / 2048.0, p.z - bias));
    }
  }
  return sum / 9.0;
}
float line(vec2 at) {
  vec2 width = fwidth(at) + 1e-5;
  vec2 near = abs(fract(at - 0.5) - 0.5) / width;
  return (1.0 - min(min(near.x, near.y), 1.0)) * clamp(0.35 / max(width.x, width.y), 0.0, 1.0);
}
void main() {
  vec3 n = normalize(facing);
  vec3 toEye = normalize(eye - point);
  if (dot(n, toEye) < 0.0) n = -n;
  vec3 own = pow(colour.rgb, vec3(2.2));
  if (floorGrid > 0.0) {
    float grid = max(0.4 * line(point.xy / floorGrid), 0.7 * line(point.xy / (10.0 * floorGrid)));
    own *= 1.0 - 0.35 * grid;
  }
  float direct = max(dot(n, sun), 0.0) * lit(n);
  vec3 sky = mix(vec3(0.34, 0.32, 0.30), vec3(0.52, 0.58, 0.66), 0.5 + 0.5 * n.z);
  vec3 light = own * (0.75 * sky + direct * vec3(1.05, 1.0, 0.92));
  vec3 half_ = normalize(toEye + sun);
  light += 0.12 * direct * pow(max(dot(n, half_), 0.0), 40.0) * (floorGrid > 0.0 ? 0.0 : 1.0);
  if (floorGrid > 0.0) {
    float far = length(point.xy - middle.xy) / (9.0 * size);
    light = mix(light, pow(haze, vec3(2.2)), smoothstep(0.25, 1.0, far));
  }
  pixel = vec4(pow(light, vec3(1.0 / 2.2)), colour.a);
}`;

const SHADOW_PIXEL = `#version 300 es
void main() {}`;

const SHADOW_PIXELS = 2048;

function program(gl, vertex, pixel) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, pixel]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
      throw new Error(gl.getShaderInfoLog(shader));
    }
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const names = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); ++i) {
    const { name } = gl.getActiveUniform(made, i);
    names[name] = gl.getUniformLocation(made, name);
  }
  return { made, names };
}

function loadMesh(gl, { vertices, indices }) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(vertices), gl.STATIC_DRAW);
  for (const place of [0, 1]) {
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 24, 12 * place);
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(indices), gl.STATIC_DRAW);
  return { array, count: indices.length };
}

function makeStage(gl, meshBytes) {
  const stage = { gl, body: program(gl, BODY_VERTEX, BODY_PIXEL),
    dark: program(gl, BODY_VERTEX, SHADOW_PIXEL), rounded: loadMesh(gl, roundedMesh(6)),
    cylinder: loadMesh(gl, roundMesh(1)), cone: loadMesh(gl, roundMesh(0)),
    square: loadMesh(gl, squareMesh()), shadow: gl.createTexture(), sunView: gl.createFramebuffer() };
  stage.own = scene.geoms.map((geom) =>
    geom.mesh ? loadMesh(gl, triangleMesh(meshBytes, geom)) : null);
  gl.bindTexture(gl.TEXTURE_2D, stage.shadow);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.DEPTH_COMPONENT24, SHADOW_PIXELS, SHADOW_PIXELS, 0,
    gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, null);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) {
    gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
  }
  gl.bindFramebuffer(gl.FRAMEBUFFER, stage.sunView);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, stage.shadow, 0);
  gl.enable(gl.DEPTH_TEST);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  return stage;
}

function drawThing(stage, used, thing) {
  const { gl } = stage;
  gl.uniform3fv(used.names.place, thing.place);
  gl.uniform4fv(used.names.turn, thing.turn);
  gl.uniform3fv(used.names.extent, thing.extent);
  gl.uniform1f(used.names.bevel, thing.bevel || 0);
  if (used.names.colour) gl.uniform4fv(used.names.colour, thing.colour);
  if (used.names.floorGrid) gl.uniform1f(used.names.floorGrid, thing.grid || 0);
  gl.bindVertexArray(thing.mesh.array);
  gl.drawElements(gl.TRIANGLES, thing.mesh.count, gl.UNSIGNED_INT, 0);
}

const SUN = unit([0.45, -0.35, 0.82]);

function sunLook(camera) {
  const reach = 1.6 * camera.size;
  const view = lookFrom(add(camera.middle, scaled(SUN, 4 * reach)), camera.middle);
  const flat = [1 / reach, 0, 0, 0, 0, 1 / reach, 0, 0, 0, 0, -1 / (4 * reach), 0, 0, 0, -1, 1];
  return matrixProduct(flat, view);
}

function cameraLook(camera, aspect) {
  const near = 0.02 * camera.distance, far = 60 * camera.distance;
  const f = 1 / Math.tan(0.5 * camera.angle);
  const lens = [f / Math.max(aspect, 0.2), 0, 0, 0, 0, f, 0, 0, 0, -0.3, (far + near) / (near - far),
    -1, 0, 0, 2 * far * near / (near - far), 0];
  return matrixProduct(lens, lookFrom(camera.eye, camera.target));
}

function draw(stage, camera, things) {
  const { gl } = stage;
  const sun = sunLook(camera);
  gl.bindFramebuffer(gl.FRAMEBUFFER, stage.sunView);
  gl.viewport(0, 0, SHADOW_PIXELS, SHADOW_PIXELS);
  gl.clear(gl.DEPTH_BUFFER_BIT);
  gl.useProgram(stage.dark.made);
  gl.uniformMatrix4fv(stage.dark.names.look, false, sun);
  for (const thing of things) {
    if (!thing.grid && thing.colour[3] === 1) drawThing(stage, stage.dark, thing);
  }
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.viewport(0, 0, world.width, world.height);
  gl.clearColor(0.74, 0.79, 0.83, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const { names } = stage.body;
  gl.useProgram(stage.body.made);
  gl.uniformMatrix4fv(names.look, false, cameraLook(camera, world.width / world.height));
  gl.uniformMatrix4fv(names.sunLook, false, sun);
  gl.uniform3fv(names.eye, camera.eye);
  gl.uniform3fv(names.sun, SUN);
  gl.uniform3fv(names.middle, camera.middle);
  gl.uniform1f(names.size, camera.size);
  for (const clear of [false, true]) { // what one sees through comes last
    gl[clear ? "enable" : "disable"](gl.BLEND);
    for (const thing of things) {
      if ((thing.colour[3] < 1) === clear) drawThing(stage, stage.body, thing);
    }
  }
}

// ---- what there is at a time ----

const POSE = 7; // columns of a body, and its role behind them
const HAND = 13; // device 3, pointer 7, force 3

function makeRun(columns) {
  const bodies = scene.bodies, hands = scene.pointers.length;
  const times = columns[columns.length - 2], peaks = columns[columns.length - 1];
  const frames = scene.frames;
  const time = (i) => times.values ? times.values[i] : times.fixed;
  const value = (k, i, share) => {
    const column = columns[k];
    if (!column.values) return column.fixed;
    const next = Math.min(i + 1, frames - 1);
    return column.values[i] + share * (column.values[next] - column.values[i]);
  };
  const several = (k, n, i, share) => Array.from({ length: n }, (_, d) => value(k + d, i, share));
  const pose = (k, i, share) => {
    const place = several(k, 3, i, share), turn = several(k + 3, 4, i, share);
    const n = Math.hypot(...turn) || 1;
    return { place, turn: turn.map((x) => x / n) };
  };
  return {
    end: time(frames - 1),
    begin: time(0),
    peak: (i) => peaks.values ? peaks.values[i] : peaks.fixed,
    peakCount: peaks.values ? peaks.values.length : 0,
    find(t) {
      let low = 0, high = frames;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (time(middle) <= t) low = middle; else high = middle;
      }
      const gap = low + 1 < frames ? time(low + 1) - time(low) : 0;
      return [low, gap > 0 ? Math.min(Math.max((t - time(low)) / gap, 0), 1) : 0];
    },
    body: (n, i, share) => pose((POSE + 1) * n, i, share),
    role: (n, i) => Math.round(value((POSE + 1) * n + POSE, i, 0)),
    hand(n, i, share) {
      const k = (POSE + 1) * bodies + HAND * n;
      return { device: several(k, 3, i, share), ...pose(k + 3, i, share),
        force: several(k + 10, 3, i, share) };
    },
  };
}

const TINT = 0.82; // of the role's colour; the rest is the body's own

function tinted(own, role) {
  const colour = scene.roles[role] ? scene.roles[role].colour : [0.8, 0.8, 0.8];
  return [0, 1, 2].map((k) => TINT * colour[k] + (1 - TINT) * own[k]).concat(1);
}

function geomThing(stage, run, number, i, share, size) {
  const geom = scene.geoms[number];
  const body = geom.body < 0 ? { place: [0, 0, 0], turn: [1, 0, 0, 0] }
    : run.body(geom.body, i, share);
  const thing = { place: add(body.place, turned(body.turn, geom.pose.slice(0, 3))),
    turn: product(body.turn, geom.pose.slice(3)),
    colour: geom.body < 0 ? [...geom.colour, 1] : tinted(geom.colour, run.role(geom.body, i)),
    extent: [1, 1, 1], mesh: stage.rounded };
  const [sphere, box, capsule, cylinder, plane] = [0, 1, 2, 3, 4];
  if (geom.shape === sphere) {
    Object.assign(thing, { bevel: geom.radius, extent: [0, 0, 0] });
  } else if (geom.shape === box) {
    const bevel = 0.05 * Math.min(...geom.edges);
    Object.assign(thing, { bevel, extent: geom.edges.map((edge) => 0.5 * edge - bevel) });
  } else if (geom.shape === capsule) {
    Object.assign(thing, { bevel: geom.radius, extent: [0, 0, 0.5 * geom.length] });
  } else if (geom.shape === cylinder) {
    Object.assign(thing, { mesh: stage.cylinder,
      extent: [geom.radius, geom.radius, 0.5 * geom.length] });
  } else if (geom.shape === plane) {
    const grid = 10 ** Math.floor(Math.log10(size / 3));
    Object.assign(thing, { mesh: stage.square, extent: [40 * size, 40 * size, 1], grid,
      colour: [0.86, 0.85, 0.83, 1] });
  } else {
    thing.mesh = stage.own[number] || stage.rounded;
  }
  return thing;
}

const HAND_COLOUR = [0.85, 0.27, 0.18];

function handThings(stage, run, number, i, share, size) {
  const form = scene.pointers[number], hand = run.hand(number, i, share), out = [];
  if (form.radius > 4 * size) return out;
  const radius = Math.max(form.radius, 0.004 * size);
  const extent = form.half.map((x) => Math.max(x, 0));
  const ball = (place, alpha) => ({ place, turn: hand.turn, mesh: stage.rounded, bevel: radius,
    extent, colour: [...HAND_COLOUR, alpha] });
  out.push(ball(hand.place, 1));
  if (norm(sub(hand.device, hand.place)) > 0.05 * radius) out.push(ball(hand.device, 0.35));
  const strength = norm(hand.force);
  if (strength > 0.02) {
    const way = scaled(hand.force, 1 / strength), turn = turnToward(way);
    const length = Math.min(0.045 * strength, 1.1) * size;
    const thick = Math.min(0.012 * size, length / 6);
    const tip = Math.min(3.5 * thick, 0.6 * length), stem = length - tip;
    const colour = [0.13, 0.19, 0.25, 1], from = hand.place;
    out.push({ place: add(from, scaled(way, 0.5 * stem)), turn, mesh: stage.cylinder, colour,
      extent: [thick, thick, 0.5 * stem] });
    out.push({ place: add(from, scaled(way, stem + 0.5 * tip)), turn, mesh: stage.cone, colour,
      extent: [2.4 * thick, 2.4 * thick, 0.5 * tip] });
  }
  return out;
}

// ---- camera, plot, controls ----

// Without the few that have rolled or flown away.
function withoutStrays(balls) {
  const share = 1 / Math.max(balls.length, 1);
  const middle = balls.reduce((sum, ball) => add(sum, scaled(ball.place, share)), [0, 0, 0]);
  const far = balls.map((ball) => norm(sub(ball.place, middle)));
  const mean = share * far.reduce((sum, x) => sum + x, 0);
  return balls.filter((ball, i) => far[i] <= 4 * mean + ball.reach);
}

// What moves is framed.
function frameAll(run) {
  const least = [Infinity, Infinity, Infinity], most = [-Infinity, -Infinity, -Infinity];
  const take = (place, reach) => {
    for (let k = 0; k < 3; ++k) {
      least[k] = Math.min(least[k], place[k] - reach);
      most[k] = Math.max(most[k], place[k] + reach);
    }
  };
  const balls = [];
  const moments = [0, 0.25, 0.5, 0.75, 1].map((x) => run.find(run.begin + x * (run.end - run.begin)));
  for (const [i, share] of moments) {
    for (const geom of scene.geoms) {
      if (geom.body < 0) continue;
      const body = run.body(geom.body, i, share);
      const place = add(body.place, turned(body.turn, geom.pose.slice(0, 3)));
      balls.push({ place, reach: geom.reach });
    }
    scene.pointers.forEach((form, n) => take(run.hand(n, i, share).place, Math.min(form.radius, 1)));
  }
  withoutStrays(balls).forEach((ball) => take(ball.place, ball.reach));
  if (!(most[0] >= least[0])) take([0, 0, 0], 0.1);
  const middle = scaled(add(least, most), 0.5);
  const size = Math.max(0.5 * norm(sub(most, least)), 1e-3);
  return { middle, target: [...middle], size, angle: 0.62, distance: 2.7 * size, turn: -2.05,
    rise: 0.48, eye: [0, 0, 0] };
}

function cameraPlace(camera) {
  const way = [Math.cos(camera.rise) * Math.cos(camera.turn),
    Math.cos(camera.rise) * Math.sin(camera.turn), Math.sin(camera.rise)];
  camera.eye = add(camera.target, scaled(way, camera.distance));
}

function cameraControls(camera, changed) {
  world.addEventListener("contextmenu", (event) => event.preventDefault());
  world.addEventListener("pointerdown", (event) => world.setPointerCapture(event.pointerId));
  world.addEventListener("pointermove", (event) => {
    if (event.buttons === 0) return;
    if (event.buttons === 1 && !event.shiftKey) {
      camera.turn -= 0.006 * event.movementX;
      camera.rise = Math.min(Math.max(camera.rise + 0.006 * event.movementY, -1.5), 1.5);
    } else {
      const back = unit(sub(camera.eye, camera.target));
      const right = unit(cross([0, 0, 1], back));
      const by = camera.distance * 0.0012;
      camera.target = add(camera.target, add(scaled(right, -by * event.movementX),
        scaled(cross(back, right), by * event.movementY)));
    }
    changed();
  });
  world.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.distance *= Math.exp(0.001 * event.deltaY);
    changed();
  }, { passive: false });
}

function fitCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  return ratio;
}

function plotDraw(run, t) {
  const canvas = at("plot"), ratio = fitCanvas(canvas), pen = canvas.getContext("2d");
  const { width, height } = canvas, low = height - 6 * ratio, high = 16 * ratio;
  let most = 0;
  for (let i = 0; i < run.peakCount; ++i) most = Math.max(most, run.peak(i));
  const x = (time) => run.end > 0 ? width * time / run.end : 0;
  const y = (force) => low - (low - high) * force / Math.max(most, 1e-9);
  pen.clearRect(0, 0, width, height);
  pen.beginPath();
  pen.moveTo(0, low);
  for (let i = 0; i < run.peakCount; ++i) {
    pen.lineTo(x(i * scene.peak_s), y(run.peak(i)));
    pen.lineTo(x((i + 1) * scene.peak_s), y(run.peak(i)));
  }
  pen.lineTo(x(run.peakCount * scene.peak_s), low);
  pen.fillStyle = "rgba(216, 69, 46, 0.22)";
  pen.fill();
  pen.strokeStyle = "#d8452e";
  pen.lineWidth = 1.4 * ratio;
  pen.stroke();
  pen.fillStyle = "#24303a";
  pen.font = `${12 * ratio}px system-ui, sans-serif`;
  pen.fillText(`force on the hand, strongest ${most.toFixed(2)} N`, 2 * ratio, 12 * ratio);
  pen.fillRect(x(t) - 0.75 * ratio, 0, 1.5 * ratio, height);
}

function listRoles(run) {
  const seen = new Set();
  for (let n = 0; n < scene.bodies; ++n) {
    for (let i = 0; i < scene.frames; i += Math.max(1, scene.frames >> 5)) seen.add(run.role(n, i));
  }
  for (const role of [...seen].sort()) {
    const item = document.createElement("li"), mark = document.createElement("i");
    const { colour, text } = scene.roles[role] || { colour: [0.8, 0.8, 0.8], text: "another" };
    mark.style.background = `rgb(${colour.map((c) => Math.round(255 * c))})`;
    item.append(mark, text);
    at("roles").append(item);
  }
}

function start(run, stage) {
  const camera = frameAll(run);
  const state = { t: run.begin, plays: false, last: 0, due: false };
  const asked = new URLSearchParams(location.hash.slice(1)).get("t");
  if (asked !== null) state.t = Math.min(Math.max(Number(asked) || 0, run.begin), run.end);

  function show() {
    const [i, share] = run.find(state.t);
    fitCanvas(world);
    cameraPlace(camera);
    const things = scene.geoms.map((_, n) => geomThing(stage, run, n, i, share, camera.size));
    scene.pointers.forEach((_, n) =>
      things.push(...handThings(stage, run, n, i, share, camera.size)));
    draw(stage, camera, things);
    plotDraw(run, state.t);
    at("time").value = run.end > run.begin ? (state.t - run.begin) / (run.end - run.begin) : 0;
    at("clock").textContent = `${state.t.toFixed(2)} / ${run.end.toFixed(2)} s`;
    at("play").textContent = state.plays ? "\u275a\u275a" : "\u25b6";
    at("now").textContent = scene.pointers.map((_, n) =>
      `${norm(run.hand(n, i, share).force).toFixed(2)} N`).join("   ");
  }

  function step(now) {
    state.due = false;
    if (state.plays) {
      state.t += Math.min((now - state.last) / 1000, 0.1);
      if (state.t >= run.end) {
        state.t = run.end;
        state.plays = false;
      }
      changed();
    }
    state.last = now;
    show();
  }

  function changed() {
    if (!state.due) requestAnimationFrame(step);
    state.due = true;
  }

  function goTo(t) {
    state.t = Math.min(Math.max(t, run.begin), run.end);
    changed();
  }

  function playOrPause() {
    state.plays = !state.plays;
    if (state.plays && state.t >= run.end) state.t = run.begin;
    state.last = performance.now();
    changed();
  }

  cameraControls(camera, changed);
  at("play").addEventListener("click", playOrPause);
  at("time").addEventListener("input", (event) => {
    state.plays = false;
    goTo(run.begin + event.target.value * (run.end - run.begin));
  });
  const scrub = (event) => {
    if (event.buttons === 0) return;
    state.plays = false;
    goTo(run.end * event.offsetX / at("plot").clientWidth);
  };
  at("plot").addEventListener("pointerdown", scrub);
  at("plot").addEventListener("pointermove", scrub);
  window.addEventListener("resize", changed);
  window.addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: -0.1, ArrowRight: 0.1 };
    if (event.target.tagName === "INPUT" || event.target.tagName === "BUTTON") return;
    if (event.key === " ") playOrPause();
    else if (ways[event.key]) goTo(state.t + ways[event.key]);
    else return;
    event.preventDefault();
  });
  listRoles(run);
  show();
  if (asked === null) playOrPause();
}

async function main() {
  const gl = world.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) {
    complain("This page needs WebGL 2, which this browser or machine does not have.");
    return;
  }
  if (typeof DecompressionStream === "undefined") {
    complain("This page needs a browser of 2023 or later: it has no DecompressionStream.");
    return;
  }
  const columns = columnsRead(await inflate("motion"));
  start(makeRun(columns), makeStage(gl, await inflate("meshes")));
}

main().catch((error) => complain(`The page cannot be shown: ${error.message}`));
