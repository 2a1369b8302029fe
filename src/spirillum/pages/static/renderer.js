// Draws a robot in its glass tube with WebGL2: meshes and poses come from Python, light and glass from here.
// Lengths are scaled so that the body's radius is 1, so that a bacterium and a metre-long model look alike to the card.

import { applied, lookAt, multiply, perspective, posed } from "./matrix.js";

const ENVIRONMENT = `
const vec3 KEY = vec3(0.2507, -0.6217, 0.7421); // towards the light
uniform vec3 u_sky, u_ground;
vec3 environment(vec3 r) {
  vec3 light = mix(u_ground, u_sky, clamp(0.5 + 0.7 * r.z, 0.0, 1.0));
  float box = clamp((dot(r, KEY) - 0.62) * 8.0, 0.0, 1.0);
  float strip = clamp((dot(r, vec3(-0.4448, 0.7117, 0.5437)) - 0.86) * 14.0, 0.0, 1.0);
  return light + vec3(1.0, 0.985, 0.96) * (1.25 * box + 0.7 * strip);
}
vec3 shown(vec3 light) {
  return sqrt(clamp(light * 1.1 / (1.0 + 0.22 * light), 0.0, 1.0)); // close to sRGB, and quick
}
// How much of the light from above a capsule from a to b, of radius r, takes from a place.
float shade(vec3 p, vec3 a, vec3 b, float r) {
  vec3 ab = b - a;
  float t = clamp(dot(p - a, ab) / dot(ab, ab), 0.0, 1.0);
  vec3 away = p - a - ab * t;
  float near = min(r * r / dot(away, away), 1.0);
  return near * clamp(near * 1.2 - 0.06, 0.0, 1.0);
}
uniform vec3 u_nose, u_rear, u_root, u_tip;
uniform vec4 u_sizes; // radius of body, of tail, of tube, strength of shadows
float shadow(vec3 p) {
  float body = shade(p, u_nose, u_rear, u_sizes.x);
  float tail = 0.55 * shade(p, u_root, u_tip, u_sizes.y);
  return u_sizes.w * max(body, tail);
}`;

const SOLID_VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 colour;
uniform mat4 u_view, u_pose;
out vec3 v_place, v_normal;
out vec4 v_colour;
void main() {
  vec4 world = u_pose * vec4(place, 1.0);
  v_place = world.xyz;
  v_normal = mat3(u_pose) * normal;
  v_colour = colour;
  gl_Position = u_view * world;
}`;

const SOLID_FRAGMENT = `#version 300 es
precision highp float;
in vec3 v_place, v_normal;
in vec4 v_colour;
uniform vec3 u_eye;
out vec4 colour;
${ENVIRONMENT}
void main() {
  vec3 n = normalize(v_normal), v = normalize(u_eye - v_place), r = reflect(-v, n);
  float grazing = 1.0 - clamp(dot(n, v), 0.0, 1.0), edge = grazing * grazing * grazing * grazing;
  float lit = clamp(dot(n, KEY), 0.0, 1.0), above = 0.5 + 0.5 * n.z;
  float wall = 1.0;
  if (u_sizes.z > 0.0) { // near the glass less light comes in
    vec2 out_of = v_place.yz;
    float towards = clamp(dot(n.yz, out_of) / max(length(out_of), 1e-4), 0.0, 1.0);
    wall = 1.0 - 0.55 * towards * (1.0 - smoothstep(0.0, 0.7, u_sizes.z - length(out_of)));
  }
  vec3 base = v_colour.rgb;
  vec3 diffuse = base * (mix(u_ground, u_sky, above) * 0.62 + 0.78 * lit) * wall;
  vec3 seen = environment(r) * wall;
  vec3 plastic = diffuse + seen * (0.035 + 0.5 * edge);
  vec3 metal = base * (0.32 * diffuse + 1.15 * seen) + base * 0.35 * lit + seen * 0.4 * edge;
  colour = vec4(shown(mix(plastic, metal, v_colour.a)), 1.0);
}`;

const GLASS_VERTEX = `#version 300 es
layout(location = 0) in vec3 place; // along (0 to 1), y and z of the unit circle
uniform mat4 u_view;
uniform vec3 u_tube; // start, end, radius
out vec3 v_place, v_normal;
out float v_along;
void main() {
  v_along = mix(u_tube.x, u_tube.y, place.x);
  v_place = vec3(v_along, place.yz * u_tube.z);
  v_normal = vec3(0.0, place.yz);
  gl_Position = u_view * vec4(v_place, 1.0);
}`;

const GLASS_FRAGMENT = `#version 300 es
precision highp float;
#define FRONT FRONT_OR_BACK
in vec3 v_place, v_normal;
in float v_along;
uniform vec3 u_eye, u_tint, u_ends; // first and last end, and how far it is seen from the middle
uniform float u_middle;
out vec4 colour;
${ENVIRONMENT}
void main() {
  vec3 v = normalize(u_eye - v_place), n = normalize(v_normal);
  float facing = dot(n, v), grazing = 1.0 - abs(facing);
  vec3 seen = environment(reflect(-v, facing < 0.0 ? -n : n));
  float rim = 1.0 - clamp(min(abs(v_along - u_ends.x), abs(v_along - u_ends.y)) * 16.0, 0.0, 1.0);
  float far = clamp((1.0 - abs(v_along - u_middle) / u_ends.z) * 2.2, 0.0, 1.0);
  float alpha = 0.42 * grazing * grazing * grazing + 0.35 * rim + (FRONT ? 0.012 : 0.05);
  float shine = clamp(seen.g - 0.9, 0.0, 1.0) * (FRONT ? 0.085 : 0.03);
  vec3 sum = shown(mix(u_tint, seen, 0.35)) * alpha + vec3(shine);
  alpha = min(alpha + shine, 1.0);
  if (!FRONT) { // the shadow lies on the glass, under its shine
    float dark = shadow(v_place);
    sum *= 1.0 - dark;
    alpha += dark * (1.0 - alpha);
  }
  colour = vec4(sum, alpha) * far;
}`;

const BENCH_VERTEX = `#version 300 es
layout(location = 0) in vec3 place; // corners of a square from -1 to 1
uniform mat4 u_view;
uniform vec3 u_bench; // x of its middle, half of its size, height
out vec3 v_place;
void main() {
  v_place = vec3(u_bench.x + place.x * u_bench.y, place.y * u_bench.y, u_bench.z);
  gl_Position = u_view * vec4(v_place, 1.0);
}`;

const BENCH_FRAGMENT = `#version 300 es
precision highp float;
in vec3 v_place;
uniform vec3 u_ink, u_bench;
uniform vec4 u_ruler; // y of its edge, width, spacing of its finest marks, tube in the air (0) or not
uniform vec2 u_ruled; // from, to
out vec4 colour;
${ENVIRONMENT}
float mark(float x, float spacing, float wide) {
  float d = abs(fract(x / spacing + 0.5) - 0.5) * spacing;
  float soft = fwidth(x) * 0.75;
  return 1.0 - smoothstep(wide * 0.5, wide * 0.5 + soft, d);
}
void main() {
  float away = length(v_place.xy - vec2(u_bench.x, 0.0)) / u_bench.y;
  float fade = 1.0 - smoothstep(0.35, 0.95, away);
  float dark = 0.75 * shadow(v_place + vec3(0.0, 0.0, u_sizes.z > 0.0 ? 0.6 : 0.0));
  if (u_sizes.z > 0.0) { // the tube's own soft shadow
    float d = abs(v_place.y) / u_sizes.z;
    dark = max(dark, u_sizes.w * 0.30 * (1.0 - smoothstep(0.0, 1.15, d)));
  }
  float line = 0.0, inside = u_ruler.x - v_place.y;
  if (inside > 0.0 && inside < u_ruler.y && v_place.x > u_ruled.x && v_place.x < u_ruled.y) {
    float s = u_ruler.z, thin = s * 0.11;
    float fine = fwidth(v_place.x) < s * 0.35 ? mark(v_place.x, s, thin) * step(inside, u_ruler.y * 0.34) : 0.0;
    float five = mark(v_place.x, 5.0 * s, thin * 1.4) * step(inside, u_ruler.y * 0.55);
    float ten = mark(v_place.x, 10.0 * s, thin * 1.8) * step(inside, u_ruler.y * 0.95);
    line = max(max(0.45 * fine, 0.6 * five), 0.85 * ten);
  }
  float alpha = max(dark, line * 0.75);
  colour = vec4(mix(vec3(0.0), u_ink, line), 1.0) * alpha * fade;
}`;

const BACK_VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
out vec2 v_at;
void main() { v_at = place.xy; gl_Position = vec4(place.xy, 0.999, 1.0); }`;

const BACK_FRAGMENT = `#version 300 es
precision highp float;
in vec2 v_at;
uniform vec3 u_low, u_high;
out vec4 colour;
void main() {
  float glow = exp(-dot(v_at * vec2(0.75, 1.0), v_at * vec2(0.75, 1.0)) * 0.9);
  vec3 c = mix(u_low, u_high, clamp(0.25 + 0.35 * v_at.y + 0.55 * glow, 0.0, 1.0));
  float grain = fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5;
  colour = vec4(c + grain / 255.0, 1.0); // no bands in soft colours
}`;

const THEMES = {
  light: {
    low: [0.875, 0.89, 0.9], high: [0.985, 0.987, 0.985], sky: [1.02, 1.03, 1.05], ground: [0.5, 0.51, 0.52],
    tint: [0.62, 0.74, 0.8], ink: [0.18, 0.24, 0.28], shadow: 0.42,
  },
  dark: {
    low: [0.035, 0.045, 0.055], high: [0.125, 0.15, 0.175], sky: [0.78, 0.83, 0.9], ground: [0.12, 0.14, 0.17],
    tint: [0.42, 0.6, 0.7], ink: [0.66, 0.74, 0.8], shadow: 0.62,
  },
};

export const ANGLE = 0.46; // of the camera, rad

export class Renderer {
  constructor(canvas) {
    this.canvas = canvas;
    this.software = inSoftware();
    const gl = canvas.getContext("webgl2", { antialias: !this.software, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser draws no WebGL2");
    this.gl = gl;
    this.programs = {
      solid: program(gl, SOLID_VERTEX, SOLID_FRAGMENT),
      front: program(gl, GLASS_VERTEX, GLASS_FRAGMENT.replace("FRONT_OR_BACK", "true")),
      rear: program(gl, GLASS_VERTEX, GLASS_FRAGMENT.replace("FRONT_OR_BACK", "false")),
      bench: program(gl, BENCH_VERTEX, BENCH_FRAGMENT),
      back: program(gl, BACK_VERTEX, BACK_FRAGMENT),
    };
    this.square = mesh(gl, new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]), [0, 1, 2, 0, 2, 3], [3]);
    this.tube = mesh(gl, ...cylinder(96, 24), [3]);
    this.parts = {};
    this.planes = []; // what is drawn between robot and glass
    this.marks = []; // and over everything
    this.theme = THEMES.light;
  }

  setTheme(name) {
    this.theme = THEMES[name] || THEMES.light;
  }

  setShape(shape) {
    const gl = this.gl, scale = 1 / shape.radius;
    this.shape = shape;
    this.scale = scale;
    for (const part of Object.values(this.parts)) part.free();
    this.parts = {};
    for (const name of ["body", "rotor"]) {
      const vertices = new Float32Array(bytes(shape[name].vertices).buffer);
      for (let i = 0; i < vertices.length; i += 10) {
        for (let k = 0; k < 3; k++) vertices[i + k] *= scale;
      }
      this.parts[name] = mesh(gl, vertices, new Uint32Array(bytes(shape[name].triangles).buffer), [3, 3, 4]);
    }
  }

  // Looks at a place from an angle and a distance; in units of the body's radius.
  camera({ target, yaw, pitch, distance }) {
    const aspect = this.canvas.width / Math.max(1, this.canvas.height);
    const c = Math.cos(pitch);
    this.eye = [
      target[0] + distance * c * Math.sin(yaw),
      target[1] - distance * c * Math.cos(yaw),
      target[2] + distance * Math.sin(pitch),
    ];
    const up = Math.abs(pitch) > 1.5 ? [-Math.sin(yaw), Math.cos(yaw), 0] : [0, 0, 1];
    this.view = multiply(perspective(ANGLE, aspect, distance * 0.02, distance * 12), lookAt(this.eye, target, up));
    this.distance = distance;
  }

  // Where a place (units of the body's radius) is on the canvas, 0 to 1; null behind the camera.
  project([x, y, z]) {
    const m = this.view;
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0) return null;
    const [a, b] = applied(m, [x, y, z]);
    return [0.5 + (0.5 * a) / w, 0.5 - (0.5 * b) / w];
  }

  draw(pose, ruler) {
    const { gl, programs, shape, theme, scale } = this;
    if (!shape || !this.view) return;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.disable(gl.BLEND);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    this.use(programs.back, { u_low: theme.low, u_high: theme.high });
    this.square.draw();
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const place = pose.position.map((value) => value * scale);
    const body = posed(place, pose.attitude), rotor = posed(place, pose.attitude, pose.tail_phase);
    const radius = shape.tube_radius === null ? 0 : shape.tube_radius * scale;
    const common = {
      u_view: this.view, u_eye: this.eye, u_sky: theme.sky, u_ground: theme.ground,
      u_nose: applied(body, [shape.nose * scale - 1, 0, 0]), u_rear: applied(body, [1 - shape.nose * scale, 0, 0]),
      u_root: applied(body, [shape.root * scale, 0, 0]), u_tip: applied(body, [shape.tip * scale, 0, 0]),
      u_sizes: [1, shape.tail_radius * scale, radius, theme.shadow],
    };
    const level = radius > 0 ? -radius * 1.06 : place[2] - 2.2;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (this.eye[2] > level) {
      this.use(programs.bench, {
        ...common, u_ink: theme.ink, u_bench: [place[0], this.distance * 1.5, level],
        u_ruler: [ruler.y, ruler.width, ruler.step, 0], u_ruled: [ruler.from, ruler.to],
      });
      this.square.draw();
    }
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(false);
    if (radius > 0) this.glass(common, radius, place[0], false);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    this.use(programs.solid, { ...common, u_pose: body });
    this.parts.body.draw();
    this.use(programs.solid, { ...common, u_pose: rotor });
    this.parts.rotor.draw();
    for (const layer of this.planes) layer.draw(this, { body, common });
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    if (radius > 0) this.glass(common, radius, place[0], true);
    gl.depthMask(true);
    for (const layer of this.marks) layer.draw(this, { body, common });
  }

  glass(common, radius, middle, front) {
    const { gl, programs, shape, theme, scale } = this;
    const centre = 0.5 * (shape.tip + shape.nose) * scale;
    const half = shape.tube_length === null ? 400 : 0.5 * shape.tube_length * scale;
    const first = centre - half, last = centre + half;
    const reach = Math.max(7 * (shape.nose - shape.tip) * scale, 2 * this.distance);
    gl.enable(gl.CULL_FACE);
    gl.cullFace(front ? gl.BACK : gl.FRONT);
    this.use(front ? programs.front : programs.rear, {
      ...common, u_tint: theme.tint, u_middle: middle,
      u_tube: [Math.max(first, middle - reach), Math.min(last, middle + reach), radius * (front ? 1.06 : 1)],
      u_ends: [first, last, reach],
    });
    this.tube.draw();
    gl.disable(gl.CULL_FACE);
  }

  use({ handle, uniforms }, values) {
    const gl = this.gl;
    gl.useProgram(handle);
    for (const [name, value] of Object.entries(values)) {
      const place = uniforms[name];
      if (place === undefined) continue;
      if (typeof value === "number") gl.uniform1f(place, value);
      else if (value.length === 16) gl.uniformMatrix4fv(place, false, value);
      else gl[`uniform${value.length}fv`](place, value);
    }
  }
}

// Without a graphics card smooth edges cost as much as all else: there they are left out.
function inSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const told = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export function program(gl, vertex, fragment) {
  const handle = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(handle, shader);
  }
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(handle));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(handle, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(handle, i);
    uniforms[name] = gl.getUniformLocation(handle, name);
  }
  return { handle, uniforms };
}

export function mesh(gl, vertices, triangles, sizes) {
  const array = gl.createVertexArray(), places = gl.createBuffer(), corners = gl.createBuffer();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, places);
  gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
  const stride = 4 * sizes.reduce((sum, size) => sum + size, 0);
  let offset = 0;
  sizes.forEach((size, location) => {
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, gl.FLOAT, false, stride, offset);
    offset += 4 * size;
  });
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, corners);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from(triangles), gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return {
    draw() {
      gl.bindVertexArray(array);
      gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
    },
    free() {
      gl.deleteVertexArray(array);
      gl.deleteBuffer(places);
      gl.deleteBuffer(corners);
    },
  };
}

function cylinder(around, along) {
  const vertices = [], triangles = [];
  for (let i = 0; i <= along; i++) {
    for (let k = 0; k <= around; k++) {
      const angle = (2 * Math.PI * k) / around;
      vertices.push(i / along, Math.cos(angle), Math.sin(angle));
    }
  }
  for (let i = 0; i < along; i++) {
    for (let k = 0; k < around; k++) {
      const a = i * (around + 1) + k, b = a + around + 1;
      triangles.push(a, a + 1, b, a + 1, b + 1, b);
    }
  }
  return [new Float32Array(vertices), triangles];
}

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}
