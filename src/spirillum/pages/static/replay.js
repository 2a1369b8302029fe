// A run replayed: the samples as they are in its file, one slider of time; also alone in one file, with no server.

import { clock, element, figure, inUnit, unitText } from "./format.js";
import { Plot } from "./plots.js";
import { Section, sectionWords } from "./section.js";
import { Stage } from "./stage.js";

const PLOTS = ["forward_velocity", "tail_rotation_rate", "motor_current", "wall_gap"];
const HEADLINE = ["forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current"];
const PACES = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20];

export function showReplay(holder, data, leave) {
  return new Replay(holder, data, leave);
}

class Replay {
  constructor(holder, data, leave) {
    const { run, quantities, shape } = data;
    Object.assign(this, { data, run, quantities, playing: true, pace: 1, going: true });
    this.first = run.time[0];
    this.last = run.time[run.time.length - 1];
    this.time = this.first;
    const stage = element("div", { class: "stage" });
    this.headline = element("dl", { class: "headline" });
    this.cells = {};
    for (const [k, name] of HEADLINE.filter((one) => run.values[one]).entries()) {
      this.cells[name] = element("dd");
      this.headline.append(element("div", { class: k ? "" : "first" }, element("dt", { text: quantities[name].label }), this.cells[name]));
    }
    this.slider = element("input", { type: "range", id: "when", min: 0, max: run.time.length - 1, step: 1, value: 0, "aria-label": "Time of the run" });
    this.clock = element("output", { class: "clock" });
    this.button = element("button", { class: "round", "aria-label": "Pause", onclick: () => this.toggle() });
    this.paceWord = element("output", { text: "1\u00d7" });
    const section = element("canvas", { role: "img", "aria-label": "Cross-section of the tube" });
    this.sectionWords = element("p", { class: "under" });
    this.drawn = (data.compared ?? []).map((one) => {
      const plot = new Plot(element("canvas", { role: "img", "aria-label": `${one.label} over time, simulated and tracked` }), one.label, one);
      plot.load(one.run.time, one.run.values);
      plot.other = one.tracked;
      return plot;
    });
    if (!data.compared) this.drawn = PLOTS.filter((name) => run.values[name]).map((name) => new Plot(element("canvas", { role: "img", "aria-label": `${quantities[name].label} over time` }), name, quantities[name]));
    if (!data.compared) for (const plot of this.drawn) plot.load(run.time, run.values[plot.name]);
    const panes = element("div", { class: "panes" }, this.filmPane(data, Boolean(leave)), stage);
    const slower = (step) => () => {
      const k = Math.min(PACES.length - 1, Math.max(0, PACES.indexOf(this.pace) + step));
      this.pace = PACES[k];
      this.paceWord.textContent = `${this.pace}\u00d7`;
    };
    holder.replaceChildren(element("section", { class: "theatre" },
      element("div", { class: "lanes" }, element("article", { class: "lane" }, panes,
        element("div", { class: "transport" }, this.button, this.slider, this.clock,
          element("button", { class: "quiet", text: "\u2212", "aria-label": "Slower", onclick: slower(-1) }), this.paceWord,
          element("button", { class: "quiet", text: "+", "aria-label": "Faster", onclick: slower(1) }),
          leave ? element("label", { class: "quiet wordy file", for: "beside-film", text: "Add video" }) : null,
          leave ? this.filmInput() : null,
          leave ? element("button", { class: "quiet wordy", text: "Another run", onclick: leave }) : null),
        element("div", { class: "strip" }, element("figure", { class: "card section" }, section, this.sectionWords),
          element("div", { class: "plots" }, ...this.drawn.map((plot) => element("figure", { class: "card plot" }, plot.canvas))))))));
    this.stage = new Stage(stage, "The robot in three dimensions; arrow keys turn, + and \u2212 zoom");
    const left = data.samples > run.time.length ? `, ${run.time.length} of ${data.samples} samples` : "";
    stage.append(element("p", { class: "name", text: `${data.robot}${data.model ? ` \u00b7 ${data.model}` : ""} \u00b7 replay${left}` }), this.headline);
    this.stage.setShape(shape);
    this.stage.setTheme(document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
    this.crossing = new Section(section);
    this.crossing.setShape(shape, data.roughness);
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    new ResizeObserver(() => { this.stale = true; }).observe(holder);
    this.seek(0);
    this.play(true);
    requestAnimationFrame((at) => this.tick(at));
  }

  // The film beside the run: that of a trial, or one of one's own, which stays in this browser.
  filmPane(data, live) {
    if (!live && !data.film) return null;
    const pane = element("div", { class: "film-pane", hidden: !data.film });
    this.video = element("video", { playsinline: true, "aria-label": "The video" });
    this.video.muted = true;
    this.start = element("input", { type: "text", id: "film-start", value: "0", inputmode: "decimal", autocomplete: "off", "aria-label": "Time of the video at which the run begins, s" });
    this.start.addEventListener("change", () => this.seek(this.sample));
    pane.append(this.video, element("label", { class: "film-start" }, "the run begins in the video at", element("span", { class: "field" }, this.start, element("span", { class: "unit", text: "s" })),
      data.compared ? element("span", { text: "dashed: tracked in the video" }) : null));
    this.pane = pane;
    if (data.film) {
      this.video.src = data.film.url;
      this.start.value = String(data.film.start);
    }
    return pane;
  }

  filmInput() {
    const input = element("input", { type: "file", id: "beside-film", accept: "video/*", onchange: () => input.files[0] && this.addFilm(input.files[0]) });
    return input;
  }

  addFilm(file) {
    if (this.url) URL.revokeObjectURL(this.url);
    this.video.src = this.url = URL.createObjectURL(file);
    this.pane.hidden = false;
    this.video.addEventListener("loadeddata", () => this.follow(), { once: true });
  }

  // The film goes where the run is; while both play it is only put right where it has drifted.
  follow() {
    if (!this.video?.src || this.video.readyState < 1) return;
    const wanted = Math.min(Math.max(this.time - this.first + (Number.parseFloat(this.start.value.replace(",", ".")) || 0), 0), this.video.duration || 0);
    const playing = this.playing && this.pace <= 4 && wanted < this.video.duration - 0.05;
    if (playing !== !this.video.paused) (playing ? this.video.play().catch(() => null) : this.video.pause());
    if (playing) this.video.playbackRate = Math.max(this.pace, 0.0625);
    if (Math.abs(this.video.currentTime - wanted) > (playing ? 0.15 : 0.01) && !this.video.seeking) this.video.currentTime = wanted;
  }

  toggle() {
    this.play(!this.playing);
  }

  play(on) {
    if (on && this.time >= this.last) this.seek(0);
    this.playing = on;
    this.button.textContent = on ? "\u2759\u2759" : "\u25b6";
    this.button.setAttribute("aria-label", on ? "Pause" : "Play");
  }

  // To one sample of the file.
  seek(sample) {
    this.play(false);
    this.time = this.run.time[sample];
    this.showAt(sample);
  }

  showAt(sample) {
    const { run } = this;
    this.sample = sample;
    this.slider.value = String(sample);
    this.shown = {
      time: run.time[sample], position: run.position[sample], attitude: run.attitude[sample], tail_phase: run.tail_phase[sample],
      values: Object.fromEntries(Object.entries(run.values).map(([name, column]) => [name, column[sample]])),
    };
    this.stage.place(this.shown);
    this.stale = true;
  }

  setTheme(name) {
    this.stage.setTheme(name);
    this.stale = true;
  }

  end() {
    this.going = false;
    if (this.url) URL.revokeObjectURL(this.url);
  }

  tick(at) {
    if (!this.going) return;
    const elapsed = Math.min((at - (this.before ?? at)) / 1000, 0.1);
    this.before = at;
    if (this.playing) {
      this.time = Math.min(this.time + elapsed * this.pace, this.last);
      this.slider.value = String(this.find(this.time));
      if (Number(this.slider.value) !== this.sample) this.showAt(Number(this.slider.value));
      if (this.time >= this.last) this.play(false);
    }
    this.follow();
    this.stage.tick(at);
    if (this.stale && this.stage.canvas.clientWidth > 0) this.write();
    requestAnimationFrame((next) => this.tick(next));
  }

  // The last sample at or before a time.
  find(time) {
    let low = 0, high = this.run.time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.run.time[middle] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  write() {
    this.stale = false;
    const { values } = this.shown;
    this.clock.textContent = `${clock(this.shown.time)} of ${figure(this.last, 4)} s`;
    for (const [name, cell] of Object.entries(this.cells)) {
      cell.replaceChildren(inUnit(values[name], this.quantities[name]), element("small", { text: ` ${unitText(this.quantities[name].unit)}` }));
    }
    this.crossing.path = this.run.position.slice(0, this.sample + 1).filter((_, k) => k % Math.ceil(this.sample / 800 || 1) === 0).map((p) => [p[1], p[2]]);
    this.crossing.draw(this.shown, values);
    this.sectionWords.textContent = sectionWords(this.data.shape, values);
    for (const plot of this.drawn) {
      plot.cursor = this.shown.time;
      plot.draw(this.first, this.last);
    }
  }
}
