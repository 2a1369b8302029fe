// Quantities over time on a canvas: a line, its newest value, a band where one is known.

import { colourOf, figure, fitted, unitText } from "./format.js";

const MOST = 2400;
const THIN = 0.05; // mm, below which lengths are read in micrometres

export class Plot {
  constructor(canvas, name, quantity) {
    Object.assign(this, { canvas, name, quantity, time: [], values: [], cursor: null, span: 20, band: null, other: null });
  }

  clear() {
    this.time = [];
    this.values = [];
  }

  load(time, values) {
    this.time = [...time];
    this.values = [...values];
  }

  add(time, value) {
    if (this.time.length && time <= this.time[this.time.length - 1]) return;
    this.time.push(time);
    this.values.push(value);
    if (this.time.length > MOST) {
      this.time = this.time.filter((_, k) => k % 2 === 0);
      this.values = this.values.filter((_, k) => k % 2 === 0);
    }
  }

  // From `from` to `to`, s; without them the last twenty seconds.
  draw(from, to) {
    const { context, width, height } = fitted(this.canvas);
    const { quantity, time, values, band } = this;
    if (width < 30) return;
    const end = to ?? Math.max(time.length ? time[time.length - 1] : 0, 4);
    const start = from ?? Math.max(0, end - this.span);
    let { factor, unit } = quantity;
    let low = Infinity, high = -Infinity;
    for (let k = 0; k < time.length; k++) {
      if (time[k] < start || time[k] > end || values[k] === null) continue;
      low = Math.min(low, values[k] * factor);
      high = Math.max(high, values[k] * factor);
    }
    if (band && Number.isFinite(low)) {
      low = Math.min(low, band.value * factor);
      high = Math.max(high, band.value * factor);
    }
    for (const value of this.other?.values ?? []) {
      if (value === null) continue;
      low = Math.min(low, value * factor);
      high = Math.max(high, value * factor);
    }
    if (!Number.isFinite(low)) [low, high] = [0, 1];
    if (unit === "mm" && Math.max(-low, high) < THIN) [low, high, factor, unit] = [1e3 * low, 1e3 * high, 1e3 * factor, "um"];
    [low, high] = rounded(low, high);
    const box = { left: 44, right: width - 8, top: 24, bottom: height - 18 };
    const x = (t) => box.left + ((t - start) / (end - start)) * (box.right - box.left);
    const y = (v) => box.bottom - ((v - low) / (high - low)) * (box.bottom - box.top);
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.lineWidth = 1;
    const step = stepOf(high - low, 3);
    for (let tick = Math.ceil(low / step - 1e-9) * step; tick <= high + 1e-9 * step; tick += step) {
      context.strokeStyle = colourOf("--line");
      context.beginPath();
      context.moveTo(box.left, Math.round(y(tick)) + 0.5);
      context.lineTo(box.right, Math.round(y(tick)) + 0.5);
      context.stroke();
      context.fillStyle = colourOf("--soft");
      context.textAlign = "right";
      context.fillText(label(tick, step), box.left - 6, y(tick));
    }
    const every = stepOf(end - start, Math.max(2, width / 80));
    context.textAlign = "center";
    for (let tick = Math.ceil(start / every) * every; tick <= end; tick += every) {
      if (x(tick) < box.left + 6 || x(tick) > box.right - 12) continue;
      context.fillText(`${label(tick, every)} s`, x(tick), height - 7);
    }
    context.save();
    context.beginPath();
    context.rect(box.left, box.top - 4, box.right - box.left, box.bottom - box.top + 8);
    context.clip();
    if (band) {
      if (band.low !== null && band.high !== null) {
        context.fillStyle = colourOf("--band");
        const top = y(band.high * factor), bottom = y(band.low * factor);
        context.fillRect(box.left, top, box.right - box.left, bottom - top);
      }
      context.setLineDash([3, 4]);
      context.strokeStyle = colourOf("--soft");
      context.beginPath();
      context.moveTo(box.left, y(band.value * factor));
      context.lineTo(box.right, y(band.value * factor));
      context.stroke();
      context.setLineDash([]);
    }
    const line = (times, column, colour, dashes) => {
      context.beginPath();
      let pen = false;
      for (let k = 0; k < times.length; k++) {
        if (times[k] < start - 1 || column[k] === null) {
          pen = false;
          continue;
        }
        context[pen ? "lineTo" : "moveTo"](x(times[k]), y(column[k] * factor));
        pen = true;
      }
      context.setLineDash(dashes);
      context.lineWidth = 1.8;
      context.lineJoin = "round";
      context.strokeStyle = colourOf(colour);
      context.stroke();
      context.setLineDash([]);
    };
    if (this.other) line(this.other.time, this.other.values, "--ink", [5, 4]);
    line(time, values, "--accent", []);
    context.restore();
    if (this.cursor !== null) {
      context.fillStyle = colourOf("--ink");
      context.fillRect(x(this.cursor) - 0.5, box.top - 4, 1, box.bottom - box.top + 8);
    }
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = colourOf("--ink");
    context.font = "600 12px system-ui, sans-serif";
    let words = capital(quantity.label), wide = context.measureText(words).width;
    if (wide > width - 60) {
      words = words.replace(" under the body", "");
      wide = context.measureText(words).width;
    }
    context.fillText(words, 10, 14);
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = colourOf("--soft");
    context.fillText(unitText(unit), 16 + wide, 14);
  }
}

// The name of a field stays as it is.
export function capital(text) {
  return /^\w+[._]\w/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1);
}

function label(value, step) {
  const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return places > 5 ? figure(value, 2) : value.toFixed(places).replace("-", "\u2212").replace(/^\u22120(\.0*)?$/, "0");
}

function stepOf(range, count) {
  const rough = range / count, power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5, 10].find((factor) => factor * power >= rough) ?? 10);
}

// A little room above and below, and never so little that noise fills the plot.
function rounded(low, high) {
  const size = Math.max(Math.abs(low), Math.abs(high), 1e-12);
  if (high - low < 0.02 * size) {
    const middle = 0.5 * (low + high);
    [low, high] = [middle - 0.01 * size, middle + 0.01 * size];
  }
  const room = 0.12 * (high - low);
  const bottom = low >= 0 && low - room < 0 ? 0 : low - room;
  return [bottom, high + room];
}
