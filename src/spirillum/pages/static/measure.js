// Measure: films are dropped, the setup is filled in by clicks and checked with every change, results stand beside their film.

import { clock, element, figure } from "./format.js";
import { capital } from "./plots.js";
import { Pointing } from "./pointing.js";

const POINTED = {
  ruler: { name: "Ruler", count: 2, words: "Click two marks of the ruler, far apart, and enter the distance between them." },
  body: { name: "Body", count: 2, words: "Click the nose, then the rear end of the body." },
  stripes: { name: "Stripes", count: 0, words: "Click every stripe that is seen across the body, once each; then take them." },
};
const WAIT = 350; // ms from a change to its check
const POLL = 400; // ms between two questions for progress

export class Measure {
  constructor(holder, lane, replay) {
    Object.assign(this, { holder, lane, replay, names: {}, film: "", time: 0, pointing: "", points: [], strips: [], said: {}, rows: {}, edits: 0, told: 0 });
    this.build();
    this.ask("state");
  }

  // Talking to Python

  // One after the other, so that no older answer comes last; a message is made when its turn comes.
  post(what, message = () => ({})) {
    const send = async () => {
      const answer = await fetch(`bench/${what}`, { method: "POST", body: JSON.stringify(message()) });
      if (!answer.ok) throw new Error(await answer.text());
      return answer.json();
    };
    const sent = (this.last ?? Promise.resolve()).then(send);
    this.last = sent.catch(() => null);
    return sent;
  }

  async ask(what, message) {
    const state = await this.post(what, () => message ?? {});
    this.take(state);
    return state.said;
  }

  // What is typed and not yet sent goes first; an answer on its way does not undo what is typed meanwhile.
  async act(what, message) {
    if (this.edits > this.told) await this.send();
    return this.ask(what, message);
  }

  async attempt(place, act) {
    try {
      this.tell(place, await act());
    } catch (error) {
      this.tell(place, error.message, true);
    }
  }

  tell(place, text, wrong = false) {
    this.said[place] = { text: typeof text === "string" ? text : "", wrong };
    const line = this.lines[place];
    line.textContent = capital(this.said[place].text);
    line.className = wrong ? "error" : "under told";
  }

  async add(files) {
    for (const file of files) {
      const kind = file.name.split(".").pop().toLowerCase();
      await this.attempt("films", async () => {
        if (kind === "toml") return this.ask("text", { text: await file.text() });
        this.tell("films", `Taking ${file.name} \u2026`);
        const answer = await fetch(`bench/film?kind=${encodeURIComponent(kind)}`, { method: "POST", body: file });
        if (!answer.ok) throw new Error(await answer.text());
        const state = await answer.json();
        this.names[state.said] = file.name;
        this.take(state);
        if (state.films.length === 1) this.propose();
        return "";
      });
    }
  }

  // What is there

  take(state) {
    const first = !this.state;
    this.state = state;
    if (first) this.buildForm();
    if (!state.films.some((film) => film.name === this.film)) this.film = "";
    if (!this.film && state.films.length) this.choose(state.films[0].name);
    this.show();
    if (state.job && !state.job.failed && !this.polling) {
      this.polling = setTimeout(() => { this.polling = null; this.ask("state").catch(() => null); }, POLL);
    }
  }

  choose(name) {
    this.film = name;
    this.time = 0;
    this.points = [];
    this.strips = [];
    this.playing = "";
    this.frame();
    this.look();
  }

  frame() {
    const image = new Image();
    const wanted = `bench/picture?film=${encodeURIComponent(this.film)}&time=${this.time.toFixed(4)}`;
    image.onload = () => { if (this.wanted === wanted) this.pointer.show(image); };
    this.wanted = wanted;
    image.src = wanted;
  }

  look() {
    const film = this.film;
    if (!film) return;
    this.attempt("look", async () => {
      const found = await this.act("look", { film });
      if (film !== this.film) return "";
      this.strips = found.strips;
      this.point();
      if (!found.lines) return "no ruler of equally spaced lines is seen: two marks give a length per pixel";
      const scale = found.length_per_pixel ? `, ${figure(1e3 * found.length_per_pixel, 4)} mm a pixel at the robot\u2019s axis, to ${figure(100 * found.uncertainty, 2)} %` : "";
      return `${found.lines} lines of the ruler are seen${scale}`;
    });
  }

  // Values that are detected reliably are filled in.
  propose() {
    const film = this.film;
    this.tell("films", "Looking for ruler and robot \u2026");
    this.attempt("films", async () => {
      const found = await this.act("propose", { film });
      const robot = found.find((one) => one.name === "robot");
      this.found.replaceChildren(element("summary", { text: "Detected in the video" }),
        ...found.map((one) => element("p", { text: `${capital(one.name.replace("_", " "))} (${one.confidence}): ${one.sentence}.` })));
      this.found.hidden = false;
      return robot.confidence === "not found" ? robot.sentence : "the robot is found; what is clear of it stands in the setup";
    });
  }

  // Pointing

  begin(what) {
    this.pointing = this.pointing === what ? "" : what;
    this.points = [];
    this.playing = "";
    this.show();
    if (this.pointing) this.pointer.canvas.focus({ preventScroll: true });
  }

  clicked(point) {
    const wanted = POINTED[this.pointing];
    if (!wanted) return;
    if (wanted.count && this.points.length >= wanted.count) this.points = [];
    this.points.push(point);
    if (this.points.length === wanted.count && (this.pointing !== "ruler" || this.length.value.trim())) this.finish();
    this.show();
  }

  finish() {
    const what = this.pointing;
    const message = { what, film: this.film, time: this.time, points: this.points, length: this.length.value.trim() };
    this.attempt(what, async () => {
      const said = await this.act("click", message);
      if (this.pointing === what) this.pointing = "";
      this.look();
      return said;
    });
  }

  point() {
    this.pointer.set(this.points, this.strips, Boolean(this.pointing));
  }

  // The page

  build() {
    const input = element("input", { type: "file", id: "film-files", multiple: true, accept: "video/*,.mkv,.toml", onchange: () => { this.add([...input.files]); input.value = ""; } });
    this.lines = Object.fromEntries(["films", "look", "ruler", "body", "stripes", "form", "work", "calibration"].map((name) => [name, element("p", { class: "under told", role: "status", id: `said-${name}` })]));
    this.stageHolder = element("div", { class: "stage film" });
    this.pointer = new Pointing(this.stageHolder, (point) => this.clicked(point));
    this.video = element("video", { controls: true, playsinline: true, hidden: true, id: "annotated" });
    this.empty = element("label", { class: "drop inside", for: "film-files" }, element("h2", { text: "Measure a video" }),
      element("p", { text: "Drop videos of a robot here, one a trial, or choose them. They stay on this machine." }), element("span", { class: "plain", text: "Choose videos" }));
    this.stageHolder.append(this.video, this.empty);
    this.slider = element("input", { type: "range", id: "frame-time", min: 0, max: 1, step: 0.01, value: 0, "aria-label": "Time in the video" });
    this.slider.addEventListener("input", () => { this.time = Number(this.slider.value); this.clock.textContent = clock(this.time); clearTimeout(this.soon); this.soon = setTimeout(() => this.frame(), 80); });
    this.clock = element("output", { class: "clock" });
    this.chips = element("div", { class: "chips", role: "group", "aria-label": "Films" });
    this.length = element("input", { type: "text", id: "ruler-length", placeholder: "such as 20 mm", autocomplete: "off", "aria-label": "Length between the two marks" });
    this.length.addEventListener("change", () => { if (this.pointing === "ruler" && this.points.length === 2) this.finish(); });
    this.buttons = {};
    const steps = Object.entries(POINTED).map(([name, { name: title, words }]) => {
      const button = this.buttons[name] = element("button", { class: "plain calm", id: `point-${name}`, "aria-pressed": "false", text: "Point", onclick: () => this.begin(name) });
      const more = name === "ruler" ? element("span", { class: "field" }, this.length) : null;
      const done = name === "stripes" ? element("button", { class: "plain", id: "take-stripes", text: "Take them", hidden: true, onclick: () => this.finish() }) : null;
      if (done) this.taken = done;
      return element("div", { class: "step" }, element("div", { class: "step-row" }, element("b", { text: title }), more, done, button), element("p", { class: "under told", text: words }), this.lines[name]);
    });
    this.found = element("details", { hidden: true });
    this.robot = element("select", { id: "measured-robot", onchange: () => this.chooseRobot() });
    this.form = element("div", {});
    this.file = element("pre", { tabindex: "0", id: "setup-text" });
    this.go = element("button", { class: "plain", id: "measure-go", text: "Measure", onclick: () => this.start() });
    this.work = element("div", { class: "table-note", hidden: true });
    this.results = element("div", {});
    this.resultsCard = element("section", { class: "card", id: "measured", "aria-label": "Results", hidden: true }, this.results);
    this.holder.replaceChildren(
      element("section", { class: "theatre", "aria-label": "Film" }, this.stageHolder,
        element("div", { class: "transport" }, element("label", { class: "plain calm", for: "film-files", text: "Add videos" }), input, this.chips, this.slider, this.clock)),
      element("aside", { class: "panel", "aria-label": "Setup and results" }, this.resultsCard,
        element("section", { class: "card", "aria-label": "Point" }, element("h2", { text: "Point" }), this.lines.look, this.lines.films, this.found, ...steps),
        element("section", { class: "card knobs", "aria-label": "Setup" }, element("h2", { text: "Setup" }),
          element("div", { class: "knob wide" }, element("label", { for: "measured-robot", text: "Robot" }), this.robot), this.form, this.lines.form,
          element("details", {}, element("summary", { text: "The setup file" }), this.file,
            element("p", { class: "files" }, element("a", { class: "plain calm", href: "bench/file?name=setup.toml", download: "setup.toml", text: "setup.toml" }), element("a", { class: "plain calm", href: "bench/file?name=robot.toml", download: "robot.toml", text: "robot.toml" })))),
        element("section", { class: "card foot", "aria-label": "Measure" }, this.go, this.lines.work, this.work)),
    );
  }

  chooseRobot() {
    const value = this.robot.value;
    this.attempt("form", () => (value === "swim" ? this.ask("robot", { lane: this.lane() }) : this.send({ "robot.file": value })).then(() => this.look()));
  }

  buildForm() {
    const groups = new Map();
    for (const entry of this.state.form) {
      if (!groups.has(entry.group)) groups.set(entry.group, []);
      groups.get(entry.group).push(entry.choices.length ? this.choice(entry) : this.entry(entry));
    }
    this.form.replaceChildren(...[...groups].map(([name, rows]) => element("fieldset", {}, element("legend", { text: name }), ...rows)));
  }

  choice(entry) {
    const buttons = entry.choices.map((name) => element("button", { role: "radio", text: name, onclick: () => this.attempt("form", () => this.send({ [entry.field]: name })) }));
    this.rows[entry.field] = { set: (value) => buttons.forEach((button) => button.setAttribute("aria-checked", String(button.textContent === value))), error: element("p", { class: "error" }) };
    return element("div", { class: "knob", title: entry.note }, element("label", { text: entry.label }), element("div", { class: "segments", role: "radiogroup", "aria-label": entry.label }, ...buttons), this.rows[entry.field].error);
  }

  entry({ field, label, example, note, uncertain }) {
    const error = element("p", { class: "error", role: "alert", id: `${field.replace(".", "-")}-wrong` });
    const made = (name, placeholder, words) => {
      const input = element("input", { type: "text", id: name.replace(".", "-"), placeholder, autocomplete: "off", spellcheck: "false", "aria-label": words, "aria-describedby": error.id });
      input.addEventListener("input", () => { this.rows[name].edited = ++this.edits; clearTimeout(this.waiting); this.waiting = setTimeout(() => this.attempt("form", () => this.send()), WAIT); });
      input.addEventListener("change", () => { clearTimeout(this.waiting); this.attempt("form", () => this.send().then(() => this.look())); });
      this.rows[name] = { input, error, edited: 0, set: (value) => { if (document.activeElement !== input && this.rows[name].edited <= this.told) input.value = Array.isArray(value) ? value.join(", ") : value ?? ""; } };
      return element("span", { class: "field" }, input);
    };
    return element("div", { class: `knob set ${uncertain ? "pair" : "lone"}`, title: note }, element("label", { for: field.replace(".", "-"), text: label }), made(field, example, label),
      uncertain ? element("span", { class: "plus", text: "\u00b1", "aria-hidden": "true" }) : null, uncertain ? made(`${field}_uncertainty`, "exact", `Standard uncertainty: ${label}`) : null, error);
  }

  async send(changed = {}) {
    let edits = 0;
    const answer = await this.post("fields", () => {
      edits = this.edits;
      const fields = { ...this.state.fields };
      for (const [name, row] of Object.entries(this.rows)) {
        if (row.input && row.edited > this.told) fields[name] = row.input.value;
      }
      return { fields: { ...fields, ...changed } };
    });
    this.told = Math.max(this.told, edits);
    this.take(answer);
  }

  start() {
    this.playing = "";
    this.pointing = "";
    this.attempt("work", () => this.act("measure"));
  }

  show() {
    const { state } = this;
    const film = state.films.find((one) => one.name === this.film);
    this.empty.hidden = Boolean(film) || Boolean(this.playing);
    this.pointer.canvas.hidden = !film || Boolean(this.playing);
    this.video.hidden = !this.playing;
    this.slider.disabled = !film || Boolean(this.playing);
    if (film) {
      this.slider.max = Math.max(0, (film.duration ?? 10) - 0.1);
      this.slider.value = this.time;
    }
    this.clock.textContent = film ? clock(this.time) : "";
    this.chips.replaceChildren(...state.films.map((one) => element("span", { class: "chip" },
      element("button", { "aria-pressed": String(one.name === this.film), text: this.names[one.name] ?? one.name, title: `${one.name}: ${one.size.join(" by ")} pixels${one.duration ? `, ${figure(one.duration, 3)} s` : ""}${one.synthetic ? ", synthetic" : ""}`, onclick: () => { this.choose(one.name); this.show(); } }),
      element("button", { text: "\u00d7", "aria-label": `Remove ${this.names[one.name] ?? one.name}`, onclick: () => this.attempt("films", () => this.ask("remove", { film: one.name })) }))));
    for (const [name, button] of Object.entries(this.buttons)) {
      button.setAttribute("aria-pressed", String(this.pointing === name));
      button.textContent = this.pointing === name ? "Stop" : "Point";
      button.disabled = !film;
    }
    this.taken.hidden = this.pointing !== "stripes" || this.points.length < 2;
    this.point();
    this.showForm();
    this.showWork();
    this.showResults();
  }

  showForm() {
    const { fields, robots, check, setup } = this.state;
    if (this.robot.dataset.names !== robots.join()) {
      this.robot.dataset.names = robots.join();
      const words = { "robot.toml": "the robot file that was dropped, or of Swim" };
      this.robot.replaceChildren(...robots.map((name) => element("option", { value: name, text: words[name] ?? name })), element("option", { value: "swim", text: "take the robot of Swim, as it is now" }));
    }
    this.robot.value = fields["robot.file"];
    for (const [name, row] of Object.entries(this.rows)) row.set(fields[name]);
    const left = [];
    for (const row of Object.values(this.rows)) row.error.textContent = "";
    for (const problem of check.problems) {
      const name = Object.keys(this.rows).sort((a, b) => b.length - a.length).find((one) => problem.startsWith(one));
      if (name && !problem.includes(" is missing")) this.rows[name].error.textContent = problem;
      else left.push(problem);
    }
    for (const [name, row] of Object.entries(this.rows)) row.input?.toggleAttribute("required", left.some((one) => one.startsWith(`${name} is missing`)));
    this.file.textContent = setup;
    const total = check.scale_uncertainty;
    this.tell("form", left.length ? left[0] : check.problems.length ? "" : total > 0 ? `the setup is whole; its heights make lengths uncertain by ${figure(100 * total, 2)} %` : "the setup is whole; it claims that all its numbers are exact");
    this.whole = !check.problems.length;
  }

  showWork() {
    const { job, films } = this.state;
    const busy = job && !job.failed;
    this.go.disabled = Boolean(busy) || !films.length || !this.whole;
    this.go.textContent = films.length > 1 ? `Measure ${films.length} videos` : "Measure";
    if (job?.failed) this.tell(job.kind === "calibrate" ? "calibration" : "work", job.failed, true);
    else if (busy && job.kind === "measure") this.tell("work", "");
    this.work.hidden = !busy;
    if (!busy) return;
    const text = { starting: "Starting", ...Object.fromEntries(Object.entries(this.names).flatMap(([name, shown]) => films.filter((one) => one.name === name).map(() => [name, shown]))) };
    const what = text[job.what] ?? job.what.replace(/^(trial-\d+)\.\w+/, (whole, name) => this.names[name] ?? whole);
    if (!this.bar) {
      this.bar = element("progress", { max: 1, value: 0 });
      this.barWords = element("p");
      this.work.replaceChildren(this.barWords, this.bar, element("button", { class: "plain calm", text: "Leave off", onclick: () => this.ask("stop") }));
    }
    this.barWords.textContent = `${what}${job.places ? `, ${job.done_places} of ${job.places}` : ""}`;
    this.bar.max = job.places || 1;
    this.bar.value = job.done_places || 0;
  }

  showResults() {
    const { measure, calibrate } = this.state.results;
    const told = JSON.stringify([measure, calibrate, this.state.job?.kind, this.names]);
    if (told === this.toldResults) return;
    this.toldResults = told;
    this.resultsCard.hidden = !measure;
    if (!measure) return;
    const tables = measure.trials.length > 1 ? [["Means over trials", measure.summary]] : [];
    for (const trial of measure.trials) tables.push([this.names[trial.name] ?? trial.name, trial.rows, trial]);
    this.results.replaceChildren(
      element("h2", {}, "Results", element("span", { class: "tag", text: measure.robot })),
      ...tables.flatMap(([title, rows, trial]) => [
        element("h3", {}, title, trial ? element("button", { class: "plain calm", text: "See it", "data-film": trial.film, onclick: () => this.play(trial.film) }) : null, trial ? element("button", { class: "plain calm", text: "Beside a simulation", "data-beside": trial.name, onclick: () => this.beside(trial.name) }) : null), table(rows),
      ]),
      element("p", { class: "under told", text: "Low and high: 95 % interval." }),
      ...warnings(measure.warnings),
      element("p", { class: "files" }, ...measure.files.filter((name) => !/\.nc$/.test(name)).map(kept), kept("setup.toml"), kept("robot.toml")),
      this.calibration(measure, calibrate),
    );
    if (this.lastMeasured !== JSON.stringify(measure)) {
      if (this.lastMeasured !== undefined || !this.playing) this.play(measure.trials[0].film);
      this.lastMeasured = JSON.stringify(measure);
    }
  }

  calibration(measure, found) {
    const select = (id, values) => element("select", { id, "aria-label": capital(id.split("-")[1]) }, ...values.map((value) => element("option", { value, text: value })));
    const model = select("calibrated-model", this.state.models), method = select("calibrated-method", this.state.methods);
    if (found) [model.value, method.value] = [found.model, found.method];
    const go = element("button", { class: "plain calm", id: "calibrate-go", text: "Calibrate", disabled: !measure.files.includes("observations.csv"), onclick: () => this.attempt("calibration", () => this.ask("calibrate", { model: model.value, method: method.value })) });
    const shown = found ? [element("h3", { text: `Model ${found.model}, ${found.method}` }), table(found.rows), ...(found.statement ? [element("p", { class: "under told", text: `${capital(found.statement)}.` })] : []), ...warnings(found.warnings),
      ...found.figures.filter((name) => /observed-/.test(name)).map((name) => element("img", { class: "drawn", src: `bench/file?name=${encodeURIComponent(name)}`, alt: "Observed against predicted" })),
      element("p", { class: "files" }, ...found.files.map(kept))] : [];
    return element("section", { class: "said", id: "calibration" }, element("h3", { text: "Calibrate the model with it" }),
      element("div", { class: "step-row" }, model, method, go), this.lines.calibration, ...shown);
  }

  // The trial on one time slider with the simulated robot, in Replay.
  beside(trial) {
    this.tell("work", "The robot is simulated \u2026");
    this.attempt("work", async () => {
      const run = await this.act("beside", { trial });
      this.video.pause();
      this.replay({ ...run, film: { ...run.film, url: `bench/file?name=${encodeURIComponent(run.film.name)}` } });
    });
  }

  play(film) {
    this.playing = film;
    this.pointing = "";
    this.video.src = `bench/file?name=${encodeURIComponent(film)}`;
    this.video.loop = true;
    this.video.muted = true;
    this.video.play().catch(() => null);
    this.show();
  }
}

function minus(text) {
  return text.replace("-", "\u2212");
}

function kept(name) {
  return element("a", { class: "plain calm", href: `bench/file?name=${encodeURIComponent(name)}&take=1`, download: name, text: name });
}

function warnings(list) {
  if (!list.length) return [];
  return [element("details", { open: list.length < 3 }, element("summary", { text: `Cautions (${list.length})` }), ...list.map((text) => element("p", { text: `${capital(text)}.` })))];
}

function table(rows) {
  const head = element("thead", {}, element("tr", {}, ...["", "value", "low", "high"].map((text) => element("th", { scope: "col", text }))));
  return element("table", { class: "found" }, head, element("tbody", {}, ...rows.map((row) => element("tr", { title: row.reason, "data-measured": row.name, "data-si": row.si },
    element("th", { scope: "row" }, capital(row.label), element("small", { text: row.unit ? ` ${row.unit}` : "" })),
    element("td", { class: "now", text: row.value === "-" ? "\u2013" : minus(row.value) }), ...[row.low, row.high].map((end) => element("td", { class: "range", text: end === "-" ? "" : minus(end) }))))));
}
