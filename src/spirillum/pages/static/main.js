// The page: hears the newest state over one websocket, shows it, and sends what is turned and pressed.

import { clock, element, inUnit, unitText } from "./format.js";
import { Measure } from "./measure.js";
import { Knobs } from "./knobs.js";
import { Numbers } from "./numbers.js";
import { Plot } from "./plots.js";
import { showReplay } from "./replay.js";
import { Section, sectionWords } from "./section.js";
import { Stage } from "./stage.js";
import { Study } from "./study.js";

const PLOTS = ["forward_velocity", "tail_rotation_rate", "motor_current"];
const PLOTS_OTHERWISE = ["forward_velocity", "tail_rotation_rate", "body_rotation_rate"];
const TABS = ["swim", "compare", "replay", "measure"];
const HEADLINE = ["forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current"];
const EACH = 110; // ms between two drawings of numbers and plots: faster is not read
const BEHIND = 0.12; // s; beyond it the page says that it is slower than requested
const $ = (id) => document.getElementById(id);
const state = { scene: null, lanes: [], past: null, chosen: 0, tab: "swim", socket: null };

const knobs = new Knobs($("knobs"), (command) => send(command));
const numbers = new Numbers($("numbers"));
state.study = new Study($("study"), (command) => send({ ...command, lane: state.chosen }));

// The wire

function connect() {
  const socket = new WebSocket(new URL("live", location.href.replace(/^http/, "ws")));
  state.socket = socket;
  socket.addEventListener("message", (event) => hear(JSON.parse(event.data)));
  socket.addEventListener("open", () => { $("lost").hidden = true; look(); });
  socket.addEventListener("close", () => {
    $("lost").hidden = false;
    setTimeout(connect, 2000);
  });
}

function send(command) {
  if (state.socket?.readyState === WebSocket.OPEN) state.socket.send(JSON.stringify(command));
}

function look() {
  send({ do: "look", value: !document.hidden && !$("live").hidden }); // the robots wait while nobody sees them
}

function hear(message) {
  if (message.t === "past") state.past = message.lanes;
  else if (message.t === "scene") setScene(message);
  else if (message.t === "frame") setFrame(message);
  else if (message.t === "refused") refuse(message);
}

function refuse({ field, lane, sentence }) {
  if (lane === state.chosen && knobs.refuse(field, sentence)) return;
  const note = $("behind");
  note.textContent = sentence;
}

// What is seen

class Lane {
  constructor(index) {
    this.index = index;
    this.holder = element("div", { class: "stage" });
    this.headline = element("dl", { class: "headline" });
    this.note = element("p", { class: "note", role: "status" });
    this.name = element("p", { class: "name" });
    const views = element("div", { class: "views", role: "group", "aria-label": "View from" });
    this.section = element("canvas", { role: "img", "aria-label": "Cross-section of the tube" });
    this.sectionWords = element("p", { class: "under" });
    this.plots = element("div", { class: "plots" });
    this.element = element("article", { class: "lane" }, this.holder, element("div", { class: "strip" },
      element("figure", { class: "card section" }, this.section, this.sectionWords), this.plots));
    this.stage = new Stage(this.holder, "The robot in three dimensions; arrow keys turn, + and \u2212 zoom");
    for (const [view, name] of [["free", "3D"], ["side", "Side"], ["top", "Top"], ["front", "Front"]]) {
      views.append(element("button", { class: "quiet wordy", text: name, onclick: () => this.stage.look(view) }));
    }
    const layers = element("div", { class: "layers", role: "group", "aria-label": "Show" });
    this.toggles = Object.fromEntries([["flow", "Flow"], ["forces", "Forces"]].map(([what, name]) => {
      const button = element("button", { class: "quiet wordy", text: name, "aria-pressed": "false", onclick: () => this.toggle(what) });
      layers.append(button);
      return [what, button];
    }));
    this.holder.append(this.name, this.headline, this.note, layers, views);
    this.crossing = new Section(this.section);
    this.generation = -1;
    this.stage.setTheme(theme());
  }

  setScene(lane, quantities) {
    this.name.textContent = `${lane.robot}${lane.swims_by ? ` \u00b7 ${lane.swims_by}` : ""}`;
    this.name.title = lane.description;
    if (lane.generation !== this.generation || !this.shape) {
      this.generation = lane.generation;
      this.frame = null; // it was of what was set before
      this.dirty = false;
      this.sectionWords.textContent = "";
      const shape = JSON.stringify(lane.shape);
      if (shape !== this.shapeText) this.stage.setShape(lane.shape);
      this.shapeText = shape;
      this.shape = lane.shape;
      this.crossing.setShape(lane.shape, lane.roughness);
      this.drawn = (lane.drive === "dc-motor" ? PLOTS : PLOTS_OTHERWISE).map((name) => {
        const canvas = element("canvas", { role: "img", "aria-label": `${quantities[name].label} over time` });
        return new Plot(canvas, name, quantities[name]);
      });
      this.plots.replaceChildren(...this.drawn.map((plot) => element("figure", { class: "card plot" }, plot.canvas)));
      this.stage.place({ position: [0, 0, restHeight(lane.shape)], attitude: [1, 0, 0, 0], tail_phase: 0 });
      const past = state.past?.[this.index];
      if (past && past.generation === lane.generation) {
        for (const plot of this.drawn) plot.load(past.time, past.values[plot.name] ?? []);
        this.crossing.path = past.path;
      }
      this.cells = {};
      this.headline.replaceChildren(...HEADLINE.map((name, k) => {
        const cell = element("dd", { text: "–" });
        this.cells[name] = cell;
        return element("div", { class: k ? "" : "first", "data-headline": name }, element("dt", { text: quantities[name].label }), cell);
      }));
    }
    this.crossing.roughness = lane.roughness;
    this.quantities = quantities;
    for (const plot of this.drawn) plot.quantity = quantities[plot.name];
    for (const plot of this.drawn) plot.band = lane.numbers?.rows[plot.name]?.value != null && lane.remote ? lane.numbers.rows[plot.name] : null;
    this.numbers = lane.numbers;
    this.takeFlow(lane.flow);
    this.trouble = lane.trouble;
    this.quietNote = !lane.trouble && lane.provisional ? "Provisional: without walls until the table of this tube is made" : "";
    this.ready = false;
    this.say("");
  }

  // The flow is computed by Python, in seconds to a minute; forces come with the numbers.
  toggle(what) {
    if (what === "flow") send({ do: "flow", value: !this.flow, lane: this.index });
    else this.showForces(!this.forcesOn);
  }

  showForces(on) {
    this.forcesOn = on;
    this.toggles.forces.setAttribute("aria-pressed", String(on));
    this.stage.setForces(on ? [...(this.numbers?.forces ?? []), ...(this.plane?.forces ?? [])] : null);
  }

  async takeFlow(flow) {
    this.flow = flow;
    this.toggles.flow.setAttribute("aria-pressed", String(Boolean(flow)));
    if (flow?.done && !this.plane) {
      const answer = await fetch(`flow?lane=${this.index}`);
      if (!answer.ok || !this.flow) return;
      this.plane = await answer.json();
      this.stage.setFlow(this.plane);
    } else if (!flow && this.plane) {
      this.plane = null;
      this.stage.setFlow(null);
    }
    this.showForces(Boolean(this.forcesOn));
    this.say(this.flowWords() || this.quietNote);
  }

  flowWords() {
    if (this.flow?.failed) return `The flow: ${this.flow.failed}.`;
    if (this.flow && !this.flow.done) return `Flow on the plane of the axis: ${this.flow.what} \u2026`;
    if (!this.plane) return this.forcesOn && state.lanes.length === 1 && this.numbers && !this.numbers.forces.some((force) => force.axis === "x") ? "Drag and thrust come with the flow" : "";
    const speed = this.quantities.forward_velocity;
    return `Flow of steady swimming (${this.plane.model}), tail at ${Math.round((180 / Math.PI) * this.plane.phase)}\u00b0; full colour: ${inUnit(this.plane.fastest, speed, 2)} ${unitText(speed.unit)}`;
  }

  setFrame(frame) {
    if (frame.generation !== this.generation) return;
    if (!frame.ready) {
      this.say(this.trouble ? "It cannot swim so; see Numbers." : "Getting ready \u2026");
      return;
    }
    this.stage.show(frame);
    this.frame = frame;
    this.crossing.add(frame.position);
    for (const plot of this.drawn) {
      const value = frame.values[plot.name];
      if (value !== undefined) plot.add(frame.time, value);
    }
    this.say(frame.ended ? `The run has ended: ${frame.ended}. Restart lays it down again.` : this.flowWords() || this.quietNote);
    this.dirty = true;
  }

  say(text) {
    if (this.note.textContent !== text) this.note.textContent = text;
    this.note.hidden = !text;
  }

  tick(at) {
    this.stage.tick(at);
    if (!this.dirty || !this.frame || at - (this.written ?? 0) < EACH) return;
    this.dirty = false;
    this.written = at;
    const values = this.frame.values;
    for (const [name, cell] of Object.entries(this.cells)) {
      const quantity = this.quantities[name];
      cell.parentElement.hidden = values[name] === undefined;
      cell.replaceChildren(inUnit(values[name], quantity), element("small", { text: ` ${unitText(quantity.unit)}` }));
    }
    this.crossing.draw(this.frame, values);
    this.sectionWords.textContent = sectionWords(this.shape, values);
    for (const plot of this.drawn) plot.draw();
  }
}

function restHeight(shape) {
  return shape.tube_radius === null ? 0 : -(shape.tube_radius - shape.radius) * 0.95;
}

function setScene(scene) {
  state.scene = scene;
  while (state.lanes.length > scene.lanes.length) state.lanes.pop().element.remove();
  while (state.lanes.length < scene.lanes.length) {
    const lane = new Lane(state.lanes.length);
    state.lanes.push(lane);
    $("lanes").append(lane.element);
  }
  $("lanes").classList.toggle("two", scene.lanes.length > 1);
  scene.lanes.forEach((lane, k) => state.lanes[k].setScene(lane, lane.quantities));
  state.chosen = Math.min(state.chosen, scene.lanes.length - 1);
  showPanel();
  $("play").innerHTML = scene.playing ? "&#10073;&#10073;" : "&#9654;";
  $("play").setAttribute("aria-label", scene.playing ? "Pause" : "Play");
  const pace = scene.pace;
  $("pace").textContent = `${pace >= 1 ? pace : `1/${Math.round(1 / pace)}`}\u00d7`;
  if (!$("live").hidden) select(scene.lanes.length > 1 ? "compare" : "swim");
}

function showPanel() {
  const { scene, chosen } = state;
  const lane = scene.lanes[chosen];
  $("which").hidden = $("study").hidden = scene.lanes.length < 2;
  $("which").replaceChildren(...scene.lanes.map((one, k) => element("button", {
    role: "tab", "aria-selected": String(k === chosen), text: `${"AB"[k]} \u00b7 ${one.robot}`,
    onclick: () => { state.chosen = k; showPanel(); },
  })));
  numbers.show(lane, lane.quantities);
  knobs.show(lane, chosen, scene);
  $("undo").disabled = lane.undo === 0;
  $("redo").disabled = lane.redo === 0;
}

function setFrame(frame) {
  state.frame = frame;
  frame.lanes.forEach((lane, k) => state.lanes[k]?.setFrame(lane));
  const first = frame.lanes[state.chosen] ?? frame.lanes[0];
  $("clock").textContent = first.ready ? clock(first.time) : "\u2026";
  if (first.ready && state.scene && performance.now() - (state.told ?? 0) > EACH && first.generation === state.scene.lanes[state.chosen]?.generation) {
    state.told = performance.now();
    numbers.now(first.values);
  }
  if (frame.playing && frame.behind > BEHIND) $("behind").textContent = "slower than requested";
  else if ($("behind").textContent === "slower than requested") $("behind").textContent = "";
}

// Tabs, time, keys

function select(tab) {
  const changed = tab !== state.tab;
  state.tab = tab;
  for (const name of TABS) $(`tab-${name}`).setAttribute("aria-selected", String(name === tab));
  $("live").hidden = tab === "replay" || tab === "measure";
  $("replay").hidden = tab !== "replay";
  $("measure").hidden = tab !== "measure";
  if (changed) look();
}

function open(tab) {
  if (tab === "compare" && state.lanes.length < 2) send({ do: "compare", value: true });
  if (tab === "swim" && state.lanes.length > 1) send({ do: "compare", value: false });
  if (tab === "replay" && !state.replay && !state.loading) askForRun();
  if (tab === "measure") state.measure ??= new Measure($("measure"), () => state.chosen, (run) => begin(run, state.tab === "measure"));
  select(tab);  // of Compare, too: the second robot comes where the first one is seen, not a replay
}

function setPace(factor) {
  send({ do: "pace", value: Math.min(64, Math.max(1 / 64, (state.scene?.pace ?? 1) * factor)) });
}

for (const tab of TABS) $(`tab-${tab}`).addEventListener("click", () => open(tab));
$("play").addEventListener("click", () => send({ do: "play", value: !state.scene?.playing }));
$("step").addEventListener("click", () => send({ do: "step" }));
$("restart").addEventListener("click", () => send({ do: "restart" }));
$("slower").addEventListener("click", () => setPace(0.5));
$("faster").addEventListener("click", () => setPace(2));
$("undo").addEventListener("click", () => send({ do: "undo", lane: state.chosen }));
$("redo").addEventListener("click", () => send({ do: "redo", lane: state.chosen }));
$("keep").addEventListener("click", () => keep());
document.addEventListener("visibilitychange", look);
document.addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
    if (event.target.matches("input[type=text]") && document.activeElement === event.target) event.target.blur();
    event.preventDefault();
    send({ do: event.shiftKey ? "redo" : "undo", lane: state.chosen });
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea") || $("keeping").open) return;
  const keys = {
    " ": () => (event.target.matches("button") ? null : state.tab === "replay" ? state.replay?.toggle() : $("play").click()),
    ".": () => $("step").click(), r: () => $("restart").click(), "[": () => setPace(0.5), "]": () => setPace(2),
    1: () => open("swim"), 2: () => open("compare"), 3: () => open("replay"), 4: () => open("measure"),
  };
  if (!keys[event.key] || (event.key === " " && event.target.matches("button"))) return;
  event.preventDefault();
  keys[event.key]();
});

// Light and dark

function theme() {
  return document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
}

function setTheme(name) {
  if (name) document.documentElement.dataset.theme = name;
  for (const lane of state.lanes) {
    lane.stage.setTheme(theme());
    lane.dirty = true;
  }
  state.replay?.setTheme(theme());
  state.measure?.pointer.draw();
}

$("theme").addEventListener("click", () => setTheme(theme() === "dark" ? "light" : "dark"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => setTheme());

// Replay

function askForRun() {
  const input = element("input", { type: "file", accept: ".nc", id: "run-file", onchange: () => input.files[0] && replay(input.files[0]) });
  const error = element("p", { class: "error", role: "alert", id: "run-error" });
  const status = element("div", { class: "table-note", role: "status", id: "run-status", hidden: true });
  const drop = element("div", { class: "drop" },
    element("h2", { text: "Replay a run" }),
    element("p", {}, "Drop the file of a run here, as ", element("code", { text: "spirillum simulate \u2026 -o run.nc" }), " writes it, or choose it."),
    element("label", { class: "plain", for: "run-file" }, "Choose a run"), input,
    element("button", { class: "plain", text: "Replay what was just seen", onclick: () => replayNow() }), status, error);
  $("replay").replaceChildren(drop);
}

function replay(file) {
  return load(`Reading ${file.name}`, () => fetch("replay", { method: "POST", body: file }));
}

function replayNow() {
  return load("Collecting the run", () => fetch(`keep/run.json?lane=${state.chosen}`));
}

// A long run takes a while: what is being done is said meanwhile, and who has gone to another view stays there.
async function load(words, ask) {
  const turn = state.loading = {};
  if (state.replay) leaveReplay();
  const status = $("run-status"), error = $("run-error");
  error.textContent = "";
  status.hidden = false;
  status.replaceChildren(element("p", { text: `${words} \u2026` }), element("progress"));
  let run = null, problem = "";
  try {
    const answer = await ask();
    if (answer.ok) run = await answer.json();
    else problem = await answer.text();
  } catch {
    problem = "The run did not arrive; is the program still running?";
  }
  if (turn !== state.loading) return; // another run was asked for meanwhile
  state.loading = null;
  status.hidden = true;
  error.textContent = problem;
  if (run) begin(run, state.tab === "replay");
}

function begin(run, show = true) {
  state.replay?.end();
  state.replay = showReplay($("replay"), { ...run, quantities: run.quantities ?? state.scene.quantities }, leaveReplay);
  state.replay.setTheme(theme());
  if (show) select("replay");
  else state.replay.play(false);
}

function leaveReplay() {
  state.replay.end();
  state.replay = null;
  askForRun();
}

// Runs are replayed; films, setups and robots are measured.
function take(files) {
  const run = files.find((file) => file.name.endsWith(".nc"));
  if (!run) {
    open("measure");
    state.measure.add(files);
    return;
  }
  if (!state.replay) askForRun();
  select("replay");
  replay(run);
}

for (const name of ["dragover", "drop"]) {
  document.addEventListener(name, (event) => {
    event.preventDefault();
    if (name === "drop" && event.dataTransfer?.files.length) take([...event.dataTransfer.files]);
  });
}

// Keep

async function keep() {
  const dialog = $("keeping"), lane = state.chosen;
  const answer = await fetch(`keep/words.json?lane=${lane}`);
  const said = answer.ok ? await answer.json() : { commands: "", python: "" };
  const block = (title, text) => {
    const copy = element("button", { class: "quiet wordy", text: "Copy", onclick: async () => {
      await navigator.clipboard?.writeText(text);
      copy.textContent = "Copied";
    } });
    return element("section", {}, element("h3", {}, title, copy), element("pre", { tabindex: "0" }, element("code", { text })));
  };
  const file = (name, words) => element("a", { class: "plain", href: `keep/${name}?lane=${lane}`, download: name, text: words });
  dialog.replaceChildren(
    element("h2", { text: "Keep" }),
    element("p", { class: "soft", text: "Everything that is seen, to take away: the same numbers on the command line and in Python, and the run as one file that replays in any browser with no server." }),
    element("p", { class: "files" }, file("run.html", "The run, one page (HTML)"), file("robot.toml", "The robot (TOML)"), file("robot.py", "Python")),
    block("Command line", said.commands), block("Python", said.python),
    element("form", { method: "dialog" }, element("button", { class: "plain", text: "Close" })),
  );
  dialog.showModal();
}

// Every frame

function tick(at) {
  requestAnimationFrame(tick);
  for (const lane of state.lanes) {
    if (!$("live").hidden) lane.tick(at);
  }
}

new ResizeObserver(() => state.lanes.forEach((lane) => { lane.dirty = true; })).observe($("lanes"));
window.spirillum = state; // for the console, and for tests
connect();
requestAnimationFrame(tick);
fetch("first-run").then((answer) => answer.json()).then((run) => {
  const wait = () => (state.scene ? run && begin(run, state.tab === "swim") : setTimeout(wait, 50));
  wait();
});
