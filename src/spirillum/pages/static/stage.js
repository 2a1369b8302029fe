// A robot on its stage: follows it with the camera, turns with the pointer and the keys, writes the ruler's numbers.

import { colourOf, element, figure, fitted } from "./format.js";
import { Arrows, FlowPlane } from "./layers.js";
import { ANGLE, Renderer } from "./renderer.js";

const VIEWS = {
  free: { yaw: -0.42, pitch: 0.27 },
  side: { yaw: 0, pitch: 0 },
  top: { yaw: 0, pitch: Math.PI / 2 - 1e-3 },
  front: { yaw: Math.PI / 2, pitch: 0.02 },
};
const SLOWEST_FRAME = 80; // ms from frame to frame; beyond it fewer pixels are drawn
const PATIENCE = 20; // frames over which that is judged

const HALF = 16; // of a label of the ruler, pixels: it is not cut at the edge

export class Stage {
  constructor(holder, label) {
    this.canvas = element("canvas", { class: "scene", tabindex: "0", role: "img", "aria-label": label });
    this.words = element("canvas", { class: "words", "aria-hidden": "true" });
    holder.append(this.canvas, this.words);
    this.renderer = new Renderer(this.canvas);
    this.view = { ...VIEWS.free };
    this.zoom = 1;
    this.sharpness = this.renderer.software ? 0.8 : 1;
    this.slow = [];
    this.frames = 0;
    this.listen();
    new ResizeObserver(() => { this.dirty = true; }).observe(holder);
    document.fonts?.ready.then(() => { this.dirty = true; });
  }

  setShape(shape) {
    this.renderer.setShape(shape);
    this.shape = shape;
    this.target = null;
    this.dirty = true;
  }

  // The plane of a flow as Python sends it; null: none.
  setFlow(plane) {
    const { renderer } = this;
    for (const layer of renderer.planes) layer.free(renderer);
    renderer.planes = plane ? [new FlowPlane(renderer, plane)] : [];
    this.dirty = true;
  }

  // Forces in N, each with its part and axis; null: none are drawn.
  setForces(forces) {
    const { renderer } = this;
    if (forces) {
      this.arrows ??= new Arrows(renderer);
      this.arrows.forces = forces;
    }
    renderer.marks = forces ? [this.arrows] : [];
    this.dirty = true;
  }

  setTheme(name) {
    this.renderer.setTheme(name);
    for (const layer of this.renderer.planes) layer.paint(this.renderer);
    this.dirty = true;
  }

  look(name) {
    Object.assign(this.view, VIEWS[name]);
    this.zoom = 1;
    this.dirty = true;
  }

  // What was told last is drawn a moment later, the way between two tellings in even pieces: drawing, no physics.
  show(pose, at = performance.now()) {
    this.from = this.now ?? pose;
    this.to = pose;
    this.span = Math.min(Math.max(at - (this.told ?? at), 1), 120);
    this.told = at;
    this.dirty = true;
  }

  place(pose) {
    this.from = this.to = this.now = pose;
    this.told = performance.now() - 1e3;
    this.span = 1;
    this.dirty = true;
  }

  tick(at) {
    if (!this.to || !this.shape) return;
    const share = Math.min((at - this.told) / this.span, 1);
    if (!this.dirty && share >= 1 && this.settled) return;
    this.settled = share >= 1;
    this.now = share >= 1 ? this.to : between(this.from, this.to, Math.max(share, 0));
    this.dirty = false;
    this.adapt(at);
    this.draw();
  }

  // Where frames come slowly while something moves all the time, fewer pixels are drawn.
  adapt(at) {
    const took = at - (this.before ?? at);
    this.before = at;
    if (took <= 0 || took > 1000) return;
    this.slow.push(took);
    if (this.slow.length < PATIENCE) return;
    const middle = this.slow.sort((a, b) => a - b)[PATIENCE / 2];
    this.slow = [];
    if (middle > SLOWEST_FRAME) this.sharpness = Math.max(0.5, this.sharpness - 0.15);
  }

  draw() {
    const { canvas, renderer, shape } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, 2) * this.sharpness;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const scale = renderer.scale;
    const whole = (shape.nose - shape.tip) * scale, radius = (shape.tube_radius ?? 1.8 * shape.radius) * scale;
    const middle = (this.now.position[0] + 0.5 * (shape.nose + shape.tip)) * scale;
    const height0 = shape.tube_radius === null ? this.now.position[2] * scale : -0.12 * radius;
    this.target = [middle, 0, height0];
    const tangent = Math.tan(ANGLE / 2), across = tangent * (width / height);
    const turned = Math.abs(Math.cos(this.view.yaw));
    const distance = Math.max((0.62 * whole * turned + 0.9 * radius) / across, (1.85 * radius) / tangent) / this.zoom;
    renderer.camera({ target: this.target, ...this.view, distance });
    this.ruler = rulerOf(whole, scale, shape, renderer.scale, middle, radius);
    renderer.draw(this.now, this.ruler);
    this.write();
    this.frames += 1;
  }

  write() {
    const { context, width, height } = fitted(this.words);
    const { ruler, renderer } = this;
    for (const { place, name, value } of renderer.marks.flatMap((layer) => layer.tips)) {
      const seen = renderer.project(place);
      if (seen) label(context, `${name} ${force(value)}`, seen[0] * width, seen[1] * height);
    }
    if (this.view.pitch < 0.08) return;
    context.font = "500 11px system-ui, sans-serif";
    context.fillStyle = colourOf("--soft");
    context.textAlign = "center";
    const level = this.shape.tube_radius === null ? this.now.position[2] * renderer.scale - 2.2 : -this.shape.tube_radius * renderer.scale * 1.06;
    let last = -1e3;
    for (let k = Math.ceil(ruler.from / (10 * ruler.step)); k * 10 * ruler.step <= ruler.to; k++) {
      const seen = renderer.project([k * 10 * ruler.step, ruler.y - ruler.width * 1.5, level]);
      if (!seen || seen[0] * width < HALF || seen[0] * width > width - HALF || seen[1] > 0.985) continue;
      const x = seen[0] * width;
      if (Math.abs(x - last) < 34) continue;
      last = x;
      context.fillText(String(Number((k * 10 * ruler.mark).toPrecision(6))).replace("-", "\u2212"), x, seen[1] * height + 4);
    }
    const end = renderer.project([ruler.to, ruler.y - ruler.width * 1.5, level]);
    if (end && end[0] < 0.97) context.fillText(ruler.unit, end[0] * width + 14, end[1] * height + 4);
  }

  listen() {
    const { canvas } = this;
    const pointers = new Map();
    let apart = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      apart = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      if (pointers.size === 1) {
        this.turn((event.clientX - before[0]) * 0.006, (event.clientY - before[1]) * 0.006);
      } else {
        const [a, b] = [...pointers.values()];
        const now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (apart > 0) this.nearer(now / apart);
        apart = now;
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.nearer(Math.exp(-event.deltaY * 0.0012));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-0.08, 0], ArrowRight: [0.08, 0], ArrowUp: [0, 0.06], ArrowDown: [0, -0.06] };
      if (turns[event.key]) this.turn(...turns[event.key]);
      else if (event.key === "+" || event.key === "=") this.nearer(1.12);
      else if (event.key === "-") this.nearer(1 / 1.12);
      else return;
      event.preventDefault();
    });
    canvas.addEventListener("dblclick", () => this.look("free"));
  }

  turn(yaw, pitch) {
    this.view.yaw -= yaw;
    this.view.pitch = Math.min(Math.max(this.view.pitch + pitch, -0.35), Math.PI / 2 - 1e-3);
    this.dirty = true;
  }

  nearer(factor) {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.35), 12);
    this.dirty = true;
  }
}

function label(context, text, x, y) {
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = colourOf("--paper");
  context.strokeText(text, x, y);
  context.fillStyle = colourOf("--ink");
  context.fillText(text, x, y);
}

function force(newtons) {
  const size = Math.abs(newtons);
  const [factor, unit] = size >= 1 ? [1, "N"] : size >= 1e-3 ? [1e3, "mN"] : size >= 1e-6 ? [1e6, "\u00b5N"] : size >= 1e-9 ? [1e9, "nN"] : [1e12, "pN"];
  return `${figure(size * factor)} ${unit}`;
}

// A ruler on the bench with marks of 1, 5 and 10 of a round step; `mark` is that step in `unit`.
function rulerOf(whole, scale, shape, perMetre, middle, radius) {
  const metres = whole / scale;
  const step = 10 ** Math.floor(Math.log10(metres / 25));
  const [factor, unit] = metres < 2e-5 ? [1e6, "\u00b5m"] : metres < 1 ? [1e3, "mm"] : [1, "m"];
  const centre = 0.5 * (shape.tip + shape.nose) * scale;
  const half = shape.tube_length === null ? 3 * whole + Math.abs(middle) : 0.5 * shape.tube_length * scale;
  return {
    step: step * scale, mark: step * factor, unit, y: -radius * 1.12, width: radius * 0.2,
    from: centre - half, to: centre + half,
  };
}

function between(a, b, share) {
  const mix = (x, y) => x + share * (y - x);
  const same = a.attitude.reduce((sum, value, k) => sum + value * b.attitude[k], 0) >= 0 ? 1 : -1;
  const attitude = a.attitude.map((value, k) => mix(value, same * b.attitude[k]));
  const size = Math.hypot(...attitude);
  return {
    position: a.position.map((value, k) => mix(value, b.position[k])),
    attitude: attitude.map((value) => value / size),
    tail_phase: mix(a.tail_phase, b.tail_phase),
  };
}
