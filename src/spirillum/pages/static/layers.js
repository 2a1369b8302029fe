// What lies over the robot's picture: the flow on a plane and forces as arrows. Numbers come from Python, their look from here.

import { colourOf } from "./format.js";
import { applied, cross, unit } from "./matrix.js";
import { mesh, program } from "./renderer.js";

const PLANE_VERTEX = `#version 300 es
layout(location = 0) in vec3 place; // corners of a square from -1 to 1
uniform mat4 u_view, u_pose;
uniform vec4 u_reach; // x from, to; z from, to
out vec2 v_at;
void main() {
  v_at = 0.5 + 0.5 * place.xy;
  gl_Position = u_view * u_pose * vec4(mix(u_reach.x, u_reach.y, v_at.x), 0.0, mix(u_reach.z, u_reach.w, v_at.y), 1.0);
}`;

const PLANE_FRAGMENT = `#version 300 es
precision highp float;
in vec2 v_at;
uniform sampler2D u_picture;
out vec4 colour;
void main() { colour = texture(u_picture, v_at); }`;

const ARROW_VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
uniform mat4 u_view, u_pose;
uniform vec3 u_arrow; // length, thickness
out vec3 v_normal;
void main() {
  float head = min(3.2 * u_arrow.y, 0.6 * u_arrow.x);
  float x = place.x < 0.5 ? place.x * 2.0 * (u_arrow.x - head) : u_arrow.x - head + (place.x - 0.5) * 2.0 * head;
  v_normal = mat3(u_pose) * normal;
  gl_Position = u_view * u_pose * vec4(x, place.yz * u_arrow.y, 1.0);
}`;

const ARROW_FRAGMENT = `#version 300 es
precision highp float;
in vec3 v_normal;
uniform vec3 u_colour;
out vec4 colour;
void main() { colour = vec4(u_colour * (0.75 + 0.25 * normalize(v_normal).z), 1.0); }`;

const WIDE = 1536; // pixels along the picture of a plane
const SMALLEST = 1e-3; // of the largest force, below which no arrow is drawn

export class FlowPlane {
  constructor(renderer, plane) {
    const { gl } = renderer;
    this.program = program(gl, PLANE_VERTEX, PLANE_FRAGMENT);
    this.square = mesh(gl, new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]), [0, 1, 2, 0, 2, 3], [3]);
    this.texture = gl.createTexture();
    this.plane = plane;
    this.velocity = plane.velocity.map((text) => new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer));
    this.paint(renderer);
  }

  free(renderer) {
    renderer.gl.deleteTexture(this.texture);
    this.square.free();
  }

  // Fuller colour is faster; the arrows have the flow's direction.
  paint(renderer) {
    const { gl } = renderer, { size: [columns, rows], fastest } = this.plane, [along, up] = this.velocity;
    const small = document.createElement("canvas");
    [small.width, small.height] = [columns, rows];
    const accent = channels(colourOf("--accent")), pixels = new ImageData(columns, rows);
    for (let k = 0; k < along.length; k++) {
      const speed = Math.hypot(along[k], up[k]), row = rows - 1 - Math.floor(k / columns);
      const share = Number.isFinite(speed) ? Math.min(speed / fastest, 1) : 0;
      pixels.data.set([...accent, 215 * Math.sqrt(share)], 4 * (row * columns + (k % columns)));
    }
    small.getContext("2d").putImageData(pixels, 0, 0);
    const large = document.createElement("canvas");
    [large.width, large.height] = [WIDE, Math.round((WIDE * rows) / columns)];
    const context = large.getContext("2d");
    context.imageSmoothingQuality = "high";
    context.drawImage(small, 0, 0, large.width, large.height);
    this.arrows(context, large);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, large);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  }

  arrows(context, { width, height }) {
    const { size: [columns, rows], fastest } = this.plane, [along, up] = this.velocity;
    const every = Math.max(2, Math.round(columns / 32)), cell = (width / columns) * every;
    context.strokeStyle = context.fillStyle = colourOf("--ink");
    context.lineWidth = 2.6;
    for (let row = every >> 1; row < rows; row += every) {
      for (let column = every >> 1; column < columns; column += every) {
        const k = row * columns + column, speed = Math.hypot(along[k], up[k]);
        if (!Number.isFinite(speed) || speed < 0.01 * fastest) continue;
        const long = cell * (0.3 + 0.6 * Math.min(speed / fastest, 1));
        context.save();
        context.translate(((column + 0.5) / columns) * width, height - ((row + 0.5) / rows) * height);
        context.rotate(-Math.atan2(up[k], along[k]));
        context.beginPath();
        context.moveTo(-0.5 * long, 0);
        context.lineTo(0.5 * long - 7, 0);
        context.stroke();
        context.beginPath();
        context.moveTo(0.5 * long, 0);
        context.lineTo(0.5 * long - 10, -5);
        context.lineTo(0.5 * long - 10, 5);
        context.fill();
        context.restore();
      }
    }
  }

  // With the robot, but it does not roll: its height is away from the nearest wall.
  draw(renderer, { body, common }) {
    const { gl, scale } = renderer, { x, z } = this.plane;
    const axis = [body[0], body[1], body[2]], place = [body[12], body[13], body[14]];
    const away = Math.hypot(place[1], place[2]) > 1e-6 && renderer.shape.tube_radius !== null ? [0, -place[1], -place[2]] : [0, 0, 1];
    const side = unit(cross(unit(away), axis)), up = cross(axis, side);
    const pose = new Float32Array([...axis, 0, ...side, 0, ...up, 0, ...place, 1]);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    renderer.use(this.program, { u_view: common.u_view, u_pose: pose, u_reach: [x[0], x[1], z[0], z[1]].map((metres) => metres * scale) });
    this.square.draw();
    gl.depthMask(true);
  }
}

export class Arrows {
  constructor(renderer) {
    this.program = program(renderer.gl, ARROW_VERTEX, ARROW_FRAGMENT);
    this.arrow = mesh(renderer.gl, ...arrowMesh(20), [3, 3]);
    this.forces = [];
    this.tips = [];
  }

  free() {
    this.arrow.free();
  }

  // Those along the axis and the upright ones have a scale each: weight is many times the thrust.
  draw(renderer, { body, common }) {
    const { gl, shape, scale } = renderer;
    this.tips = [];
    gl.clear(gl.DEPTH_BUFFER_BIT); // over everything
    gl.disable(gl.BLEND);
    const largest = {};
    for (const { axis, value } of this.forces) largest[axis] = Math.max(largest[axis] ?? 0, Math.abs(value));
    const ink = channels(colourOf("--ink")).map((value) => value / 255), accent = channels(colourOf("--accent")).map((value) => value / 255);
    for (const { name, at, axis, value } of this.forces) {
      const size = Math.abs(value) / largest[axis];
      if (!(size > SMALLEST)) continue;
      const middle = at === "tail" ? 0.5 * (shape.root + shape.tip) * scale : 0;
      const along = [body[0], body[1], body[2]], upright = axis === "z";
      const towards = (upright ? [0, 0, 1] : along).map((part) => part * Math.sign(value));
      const long = (upright ? 1.7 : 2.2) * size, thick = 0.1;
      const pushed = at === "body" && !upright; // the fluid pushes against the nose
      const from = applied(body, [pushed ? shape.nose * scale + (value < 0 ? 1 : -1) * long : middle, 0, 0]);
      const side = unit(cross(Math.abs(towards[2]) > 0.9 ? [0, 1, 0] : [0, 0, 1], towards)), up = cross(towards, side);
      const beside = upright ? long + 0.3 : 0.5 * long;
      this.tips.push({ place: from.map((part, k) => part + beside * towards[k] + (upright || k < 2 ? 0 : 0.45)), name, value });
      const pose = new Float32Array([...towards, 0, ...side, 0, ...up, 0, ...from, 1]);
      renderer.use(this.program, { u_view: common.u_view, u_pose: pose, u_arrow: [long, thick, 0], u_colour: upright ? ink : accent });
      this.arrow.draw();
    }
  }
}

// Along x from 0 to 1, the head from 0.5 on; radii in thicknesses.
function arrowMesh(around) {
  const rings = [[0, 0], [0, 0.5], [0.5, 0.5], [0.5, 1.3], [1, 0]], vertices = [], triangles = [];
  rings.forEach(([x, radius]) => {
    for (let k = 0; k <= around; k++) {
      const angle = (2 * Math.PI * k) / around;
      vertices.push(x, radius * Math.cos(angle), radius * Math.sin(angle), 0, Math.cos(angle), Math.sin(angle));
    }
  });
  // the shader tells shaft and head apart by x: rings at 0.5 belong to the head
  for (let i = 0; i + 1 < rings.length; i++) {
    for (let k = 0; k < around; k++) {
      const a = i * (around + 1) + k, b = a + around + 1;
      triangles.push(a, a + 1, b, a + 1, b + 1, b);
    }
  }
  return [new Float32Array(vertices), triangles];
}

function channels(colour) {
  const context = document.createElement("canvas").getContext("2d");
  context.fillStyle = colour;
  context.fillRect(0, 0, 1, 1);
  return [...context.getImageData(0, 0, 1, 1).data.slice(0, 3)];
}
