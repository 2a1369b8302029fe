// A study as a map of its tails: wavelengths and amplitudes, colour and number for the speed; press a tail, and it swims.

import { element, figure } from "./format.js";

const MOST_WORDS = 9; // columns in which there is room for numbers

export class Study {
  constructor(holder, pick) {
    Object.assign(this, { holder, pick, chosen: "" });
    this.input = element("input", { type: "file", id: "study-file", accept: ".nc", onchange: () => { if (this.input.files[0]) this.load(this.input.files[0]); this.input.value = ""; } });
    this.error = element("p", { class: "error", role: "alert" });
    this.body = element("div", {});
    holder.replaceChildren(element("h2", {}, "A study", element("span", { class: "study-from" },
      element("button", { class: "plain calm", id: "study-paper", text: "The paper\u2019s", onclick: () => this.load(null) }), element("label", { class: "plain calm", for: "study-file", text: "Open" }), this.input)), this.body, this.error);
    this.body.append(element("p", { class: "under told", text: "Open the dataset.nc of a study, or the paper\u2019s sixteen tails, and press a tail: it swims." }));
  }

  async load(file) {
    this.error.textContent = "";
    this.body.replaceChildren(element("p", { class: "under told", text: file ? "Reading \u2026" : "Computing \u2026" }));
    const answer = await fetch("study", { method: "POST", body: file ?? "" });
    if (!answer.ok) {
      this.error.textContent = await answer.text();
      this.body.replaceChildren();
      return;
    }
    this.study = await answer.json();
    this.build();
  }

  build() {
    const { study } = this;
    const select = (name, values) => element("select", { "aria-label": name, onchange: () => this.draw() }, ...values.map((text, value) => element("option", { value, text })));
    this.channel = select("Channel", study.channels);
    this.model = select("Model", study.models);
    this.map = element("div", { class: "map", role: "group", "aria-label": "Speed by wavelength and amplitude" });
    this.words = element("p", { class: "under told", "aria-live": "polite", text: "Speed in mm/s. Press a tail: it swims." });
    this.body.replaceChildren(element("p", { class: "under told", text: study.title }), element("div", { class: "step-row" }, this.channel, this.model), this.map, this.words);
    this.draw();
  }

  tell(w, a, speed) {
    const { study } = this;
    return `wavelength ${figure(1e3 * study.wavelengths[w])} mm, amplitude ${figure(1e3 * study.amplitudes[a])} mm: ${speed === null ? "no answer" : `${figure(1e3 * speed)} mm/s`}`;
  }

  // A map: wavelengths to the right, amplitudes upwards, fuller colour for more speed.
  draw() {
    const { study, map } = this;
    if (!study) return;
    const channel = Number(this.channel.value), speeds = study.speeds[channel][this.model.value];
    const most = Math.max(...speeds.flat().map((speed) => Math.abs(speed ?? 0)), 1e-12), many = study.wavelengths.length > MOST_WORDS;
    map.style.gridTemplateColumns = `48px repeat(${study.wavelengths.length}, minmax(0, 1fr))`; // through the object model: a policy forbids styles in the markup
    const cells = speeds.flatMap((row, a) => [element("span", { class: "edge", text: figure(1e3 * study.amplitudes[a], 2) }), ...row.map((speed, w) => this.cell(speed, w, a, channel, most, many))]);
    const rows = Array.from({ length: speeds.length }, (_, a) => cells.slice(a * (study.wavelengths.length + 1), (a + 1) * (study.wavelengths.length + 1)));
    map.replaceChildren(...rows.reverse().flat(), element("span", { class: "edge", text: "a \u2191 \u03bb \u2192" }), ...study.wavelengths.map((value) => element("span", { class: "edge foot-edge", text: figure(1e3 * value, 2) })));
  }

  cell(speed, w, a, channel, most, many) {
    const words = this.tell(w, a, speed), share = Math.abs(speed ?? 0) / most;
    const button = element("button", {
      class: "tail", disabled: speed === null, "aria-label": words, title: words, "aria-pressed": String(this.chosen === `${channel} ${w} ${a}`), "data-tail": `${w} ${a}`, text: many || speed === null ? "" : figure(1e3 * speed, 2),
      onclick: () => {
        this.chosen = `${channel} ${w} ${a}`;
        this.pick({ do: "tail", channel, wavelength: w, amplitude: a });
        for (const other of this.map.querySelectorAll(".tail")) other.setAttribute("aria-pressed", String(other === button));
        this.words.textContent = `${words}; it swims`;
      },
    });
    button.style.background = `color-mix(in srgb, var(--accent) ${Math.round(8 + 37 * share)}%, var(--card))`;
    return button;
  }
}
