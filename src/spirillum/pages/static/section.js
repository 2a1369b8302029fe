// The tube's cross-section as seen from its front: the body where it is, the way of its middle, and its film, enlarged.

import { colourOf, fitted, length } from "./format.js";

const MOST = 1200;
const THINNEST = 1e-6, THICKEST = 3e-3; // ends of the gauge of the film, m

export class Section {
  constructor(canvas) {
    this.canvas = canvas;
    this.path = [];
  }

  setShape(shape, roughness) {
    this.shape = shape;
    this.roughness = roughness;
    this.path = [];
  }

  add(position) {
    this.path.push([position[1], position[2]]);
    if (this.path.length > MOST) this.path = this.path.filter((_, k) => k % 2 === 0);
  }

  draw(pose, values) {
    const { context, width, height } = fitted(this.canvas);
    const shape = this.shape;
    if (!shape || !pose || width < 20) return;
    const gauge = shape.tube_radius === null ? 0 : 74;
    const radius = shape.tube_radius ?? 2 * shape.radius;
    const size = Math.min(width - gauge, height) / 2 - 8;
    const middle = [(width - gauge) / 2, height / 2], scale = size / radius;
    const at = (y, z) => [middle[0] + y * scale, middle[1] - z * scale];
    if (shape.tube_radius !== null) {
      context.beginPath();
      context.arc(...middle, size, 0, 2 * Math.PI);
      context.fillStyle = colourOf("--glass");
      context.fill();
      context.lineWidth = 2;
      context.strokeStyle = colourOf("--glass-edge");
      context.stroke();
    }
    const discs = ellipses(pose, shape.profile);
    const fill = (style, grow) => {
      context.fillStyle = style;
      for (const disc of discs) {
        context.beginPath();
        const [x, y] = at(disc.y, disc.z);
        context.ellipse(x, y, Math.max(disc.wide * scale + grow, 0), Math.max(disc.narrow * scale + grow, 0), disc.angle, 0, 2 * Math.PI);
        context.fill();
      }
    };
    fill(colourOf("--body-edge"), 0.8);
    fill(colourOf("--body"), -0.7);
    if (this.path.length > 1) {
      context.beginPath();
      this.path.forEach(([y, z], k) => context[k ? "lineTo" : "moveTo"](...at(y, z)));
      context.lineWidth = 1.5;
      context.strokeStyle = colourOf("--accent");
      context.stroke();
    }
    const [x, y] = at(pose.position[1], pose.position[2]);
    context.beginPath();
    context.arc(x, y, 3.2, 0, 2 * Math.PI);
    context.fillStyle = colourOf("--accent");
    context.fill();
    if (gauge) this.film(context, width - gauge + 12, height, values);
  }

  film(context, left, height, values) {
    const top = 22, bottom = height - 14, gap = values.wall_gap, load = values.contact_force;
    const place = (h) => {
      const share = Math.log(Math.min(Math.max(h, THINNEST), THICKEST) / THINNEST) / Math.log(THICKEST / THINNEST);
      return bottom - share * (bottom - top);
    };
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillStyle = colourOf("--soft");
    context.fillText("film", left, 12);
    context.fillStyle = colourOf("--line");
    context.fillRect(left, top, 7, bottom - top);
    for (const [h, name] of [[1e-6, "1 \u00b5m"], [1e-5, "10"], [1e-4, "100"], [1e-3, "1 mm"]]) {
      context.fillStyle = colourOf("--line");
      context.fillRect(left + 7, place(h), 4, 1);
      context.fillStyle = colourOf("--soft");
      context.fillText(name, left + 15, place(h) + 4);
    }
    if (this.roughness) {
      context.fillStyle = colourOf("--warn");
      context.fillRect(left - 3, place(this.roughness) - 1, 13, 2);
    }
    if (gap === null || gap === undefined) return;
    context.fillStyle = colourOf(load > 0 ? "--warn" : "--accent");
    context.fillRect(left, place(gap), 7, bottom - place(gap));
    context.beginPath();
    context.arc(left + 3.5, place(gap), 5, 0, 2 * Math.PI);
    context.fill();
  }
}

export function sectionWords(shape, values) {
  if (shape.tube_radius === null) return "no tube: a free fluid";
  const film = `film ${length(values.wall_gap)}`;
  const load = values.contact_force;
  if (load === undefined || load === null) return film;
  return load > 0 ? `${film}, contact ${(1e3 * load).toPrecision(2)} mN` : `${film}, no contact`;
}

// Circles about the body's axis as seen along x.
function ellipses({ position, attitude: [w, x, y, z] }, profile) {
  const axis = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)];
  const angle = Math.atan2(-axis[2], axis[1]);
  return profile.filter(([, rho]) => rho > 0).map(([along, rho]) => ({
    y: position[1] + along * axis[1], z: position[2] + along * axis[2],
    wide: rho * Math.abs(axis[0]), narrow: rho, angle,
  }));
}
