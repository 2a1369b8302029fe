// A frame of a film to point at: clicks as crosses with their number, a magnifier, and arrow keys for who has no mouse.

import { colourOf, element, fitted } from "./format.js";

const LENS = 64; // radius of the magnifier, pixels of the screen

export class Pointing {
  constructor(holder, added) {
    this.canvas = element("canvas", { class: "pointing", tabindex: "0", role: "application", "aria-label": "The video\u2019s frame: click, or move the cross with the arrow keys (Shift: farther) and press Enter" });
    this.told = element("p", { class: "name", "aria-live": "polite" });
    holder.append(this.canvas, this.told);
    Object.assign(this, { points: [], strips: [], marks: [], image: null, cursor: null, added, active: false });
    new ResizeObserver(() => this.draw()).observe(holder);
    this.listen();
  }

  show(image) {
    this.image = image;
    this.draw();
  }

  // Points are pixels of the film.
  set(points, strips, active) {
    Object.assign(this, { points, strips, active });
    this.canvas.classList.toggle("active", active);
    this.draw();
  }

  place() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = Math.min(width / this.image.naturalWidth, height / this.image.naturalHeight);
    return { scale, left: (width - scale * this.image.naturalWidth) / 2, top: (height - scale * this.image.naturalHeight) / 2 };
  }

  at(event) {
    const { scale, left, top } = this.place();
    const box = this.canvas.getBoundingClientRect();
    return this.inside([(event.clientX - box.left - left) / scale - 0.5, (event.clientY - box.top - top) / scale - 0.5]);
  }

  inside([u, v]) {
    return [Math.min(Math.max(u, 0), this.image.naturalWidth - 1), Math.min(Math.max(v, 0), this.image.naturalHeight - 1)];
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointermove", (event) => {
      if (!this.image) return;
      this.cursor = this.at(event);
      this.draw();
    });
    canvas.addEventListener("pointerleave", () => { this.cursor = null; this.draw(); });
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.image || !this.active) return;
      this.cursor = this.at(event);
      this.added(this.cursor);
    });
    canvas.addEventListener("keydown", (event) => {
      if (!this.image) return;
      const step = event.shiftKey ? 20 : 1;
      const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
      this.cursor ??= [this.image.naturalWidth / 2, this.image.naturalHeight / 2];
      if (moves[event.key]) this.cursor = this.inside([this.cursor[0] + moves[event.key][0], this.cursor[1] + moves[event.key][1]]);
      else if (event.key === "Enter" && this.active) this.added(this.cursor);
      else return;
      event.preventDefault();
      this.told.textContent = `column ${Math.round(this.cursor[0])}, row ${Math.round(this.cursor[1])}`;
      this.draw();
    });
  }

  draw() {
    const { context, width, height } = fitted(this.canvas);
    if (!this.image || width < 20) return;
    const { scale, left, top } = this.place();
    const to = ([u, v]) => [left + (u + 0.5) * scale, top + (v + 0.5) * scale];
    context.imageSmoothingQuality = "high";
    context.drawImage(this.image, left, top, scale * this.image.naturalWidth, scale * this.image.naturalHeight);
    context.strokeStyle = colourOf("--accent");
    context.lineWidth = 1.5;
    for (const [u0, v0, u1, v1] of this.strips) {
      const [x, y] = to([u0 - 1, v0 - 1]), [x1, y1] = to([u1 + 1, v1 + 1]);
      context.strokeRect(x, y, x1 - x, y1 - y);
    }
    this.points.forEach((point, k) => cross(context, to(point), String(k + 1)));
    if (this.cursor && this.active) this.magnify(context, to(this.cursor), width, scale);
  }

  magnify(context, [x, y], width, scale) {
    const right = x + 2.6 * LENS < width;
    const centre = [right ? x + 1.5 * LENS : x - 1.5 * LENS, Math.max(y - LENS, LENS + 4)];
    const enlarged = Math.max(2 * scale, Math.min(9, 6 * scale)); // pixels of the screen for one of the film
    const part = LENS / enlarged, [u, v] = this.cursor;
    context.save();
    context.beginPath();
    context.arc(...centre, LENS, 0, 2 * Math.PI);
    context.fillStyle = colourOf("--card");
    context.fill();
    context.clip();
    context.imageSmoothingEnabled = false;
    context.drawImage(this.image, u + 0.5 - part, v + 0.5 - part, 2 * part, 2 * part, centre[0] - LENS, centre[1] - LENS, 2 * LENS, 2 * LENS);
    context.restore();
    context.beginPath();
    context.arc(...centre, LENS, 0, 2 * Math.PI);
    context.lineWidth = 2;
    context.strokeStyle = colourOf("--accent");
    context.stroke();
    cross(context, centre, "");
  }
}

// A cross that is seen on any ground: dark within light.
function cross(context, [x, y], name) {
  for (const [colour, wide] of [["#ffffff", 4], ["#0b1114", 1.6]]) {
    context.beginPath();
    context.moveTo(x - 9, y);
    context.lineTo(x + 9, y);
    context.moveTo(x, y - 9);
    context.lineTo(x, y + 9);
    context.lineWidth = wide;
    context.strokeStyle = colour;
    context.stroke();
  }
  if (!name) return;
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "left";
  context.lineWidth = 3;
  context.strokeStyle = "#ffffff";
  context.strokeText(name, x + 6, y - 6);
  context.fillStyle = "#0b1114";
  context.fillText(name, x + 6, y - 6);
}
