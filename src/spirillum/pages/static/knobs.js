// The knobs: each a slider and a field with its unit; what is wrong with a value stands below it, in a sentence.

import { element, figure, unitText } from "./format.js";

const EACH = 40; // ms between two values that a slider sends

export class Knobs {
  constructor(holder, send) {
    this.holder = holder;
    this.send = send;
    this.rows = {};
    this.form = "";
  }

  show(lane, index, scene) {
    this.lane = index;
    const form = JSON.stringify([index, lane.knobs.map((knob) => [knob.field, knob.low, knob.high, knob.unit]), lane.models, lane.drive, scene.presets, lane.source]);
    if (form !== this.form) this.build(lane, scene, form);
    if (lane.generation !== this.generation) Object.values(this.rows).forEach((row) => row.clear());
    this.generation = lane.generation;
    for (const knob of lane.knobs) this.rows[knob.field]?.set(knob);
    this.preset.value = scene.presets.includes(lane.source) ? lane.source : "own";
    this.model.value = lane.model;
    this.remote.setAttribute("aria-checked", String(lane.remote));
    this.remoteWord.textContent = lane.remote ? "on" : "off";
    if (document.activeElement !== this.duty) this.duty.value = lane.duty;
    this.dutyWord.textContent = `${Math.round(100 * lane.duty)} %`;
    this.table.hidden = !(lane.provisional || lane.preparing);
    if (!this.table.hidden) this.tell(lane);
  }

  tell(lane) {
    const said = lane.preparing;
    const working = said && !said.failed;
    this.table.replaceChildren(
      element("p", { text: working ? `Table of this robot in its tube: ${said.what}${said.places ? `, ${said.done_places} of ${said.places}` : ""}` : said?.failed ? said.failed : "This robot swims provisionally without walls, until the table of its tube is made, in minutes." }),
      ...(working && said.places ? [element("progress", { max: said.places, value: said.done_places })] : []),
      element("button", { class: "plain", text: working ? "Leave off" : "Make its table", onclick: () => this.send({ do: working ? "leave-off" : "prepare", lane: this.lane }) }),
    );
  }

  build(lane, scene, form) {
    this.form = form;
    this.rows = {};
    const names = [...(scene.own === "own" || lane.source === "own" ? ["own"] : []), ...scene.presets];
    this.preset = element("select", { id: "preset", onchange: () => this.send({ do: "preset", value: this.preset.value, lane: this.lane }) },
      ...names.map((name) => element("option", { value: name, text: name === "own" ? scene.own === "own" ? "the robot it was started with" : "the study\u2019s robot" : name })));
    const words = { auto: "auto: the most complete", tube: "tube: with walls", slender: "slender: no walls", rft: "rft: the paper\u2019s simplest" };
    this.model = element("select", { id: "model", onchange: () => this.set("run.model", this.model.value) },
      ...lane.models.map((name) => element("option", { value: name, text: words[name] })));
    this.remoteWord = element("span");
    this.remote = element("button", { id: "remote", class: "switch", role: "switch", "aria-label": "Remote", onclick: () => this.send({ do: "remote", value: this.remote.getAttribute("aria-checked") !== "true", lane: this.lane }) }, element("i"), this.remoteWord);
    this.duty = element("input", { id: "duty", type: "range", min: 0.05, max: 1, step: 0.01, "aria-label": "Duty (PWM)" });
    this.duty.addEventListener("input", spaced(() => this.send({ do: "duty", value: Number(this.duty.value), lane: this.lane })));
    this.dutyWord = element("output");
    this.table = element("div", { class: "table-note", hidden: true });
    const groups = new Map([["Drive", []]]);
    for (const knob of lane.knobs) {
      const row = knob.choices.length ? this.choice(knob) : this.slider(knob);
      this.rows[knob.field] = row;
      if (!groups.has(knob.group)) groups.set(knob.group, []);
      groups.get(knob.group).push(row.element);
    }
    groups.get("Drive").unshift(
      element("div", { class: "knob", title: "Switches the motor on and off, as the remote control does." }, element("label", { text: "Remote" }), this.remote),
      element("div", { class: "knob", title: "Share of the time for which the battery drives the motor (PWM)." }, element("label", { for: "duty", text: "Duty" }), this.duty, element("span", { class: "field" }, this.dutyWord)),
    );
    this.holder.replaceChildren(
      element("h2", { text: "Settings" }),
      element("div", { class: "knob wide" }, element("label", { for: "preset", text: "Robot" }), this.preset),
      element("div", { class: "knob wide" }, element("label", { for: "model", text: "Model" }), this.model),
      this.table,
      ...[...groups].map(([name, rows]) => element("fieldset", {}, element("legend", { text: name }), ...rows)),
    );
  }

  set(field, value) {
    this.rows[field]?.clear();
    this.send({ do: "set", field, value, lane: this.lane });
  }

  refuse(field, text) {
    const row = this.rows[field];
    if (row) row.refuse(text);
    return Boolean(row);
  }

  choice(knob) {
    const group = element("div", { class: "segments", role: "radiogroup", "aria-label": knob.label });
    const buttons = knob.choices.map((name) => element("button", { role: "radio", text: name, onclick: () => this.set(knob.field, name) }));
    group.append(...buttons);
    const error = element("p", { class: "error", role: "alert" });
    return {
      element: element("div", { class: "knob", title: knob.note }, element("label", { text: knob.label }), group, error),
      set: (now) => buttons.forEach((button) => button.setAttribute("aria-checked", String(button.textContent === now.value))),
      refuse: (text) => { error.textContent = text; },
      clear: () => { error.textContent = ""; },
    };
  }

  slider(knob) {
    const id = knob.field.replace(".", "-");
    const bar = element("input", { type: "range", min: 0, max: 1000, step: 1, id: `${id}-slider`, tabindex: "-1", "aria-hidden": "true" });
    const text = element("input", { type: "text", id, inputmode: "decimal", autocomplete: "off", spellcheck: "false", placeholder: knob.unset });
    const error = element("p", { class: "error", id: `${id}-error`, role: "alert" });
    text.setAttribute("aria-describedby", error.id);
    const { low, high, logarithmic } = knob;
    const value = (share) => (logarithmic ? low * (high / low) ** share : low + (high - low) * share);
    const share = (v) => Math.min(1, Math.max(0, logarithmic ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low)));
    const send = (shown) => this.set(knob.field, shown === "" ? "" : /[a-z\u00b5\u00b0]/i.test(shown) ? shown.replace("\u00b5", "u").replace("\u00b0", "deg") : `${shown.replace(",", ".").replace("\u2212", "-")} ${knob.unit}`);
    const soon = spaced(() => send(text.value));
    bar.addEventListener("input", () => {
      text.value = figure(value(bar.value / 1000), 3).replace("\u2212", "-");
      soon();
    });
    text.addEventListener("change", () => send(text.value.trim()));
    text.addEventListener("keydown", (event) => {
      const steps = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!steps) return;
      event.preventDefault();
      const now = Number.parseFloat(text.value) || value(0.5);
      const size = 10 ** Math.floor(Math.log10(Math.max(Math.abs(now), 1e-9)) - (event.shiftKey ? 0 : 1));
      text.value = String(Number((now + steps * size).toPrecision(4)));
      soon();
    });
    const unit = element("span", { class: "unit", text: unitText(knob.unit) });
    return {
      element: element("div", { class: "knob", title: knob.note }, element("label", { for: id, text: knob.label }), bar, element("span", { class: "field" }, text, unit), error),
      set: (now) => {
        bar.classList.toggle("unset", now.value === null);
        unit.hidden = now.value === null && document.activeElement !== text;
        if (document.activeElement !== bar) bar.value = now.value === null ? 1000 * share(low + 0.5 * (high - low)) : 1000 * share(now.value);
        if (document.activeElement !== text && document.activeElement !== bar) {
          text.value = now.value === null ? "" : String(Number(now.value.toPrecision(6)));
          if (!error.dataset.held) error.textContent = "";
        }
      },
      refuse: (sentence) => { error.textContent = sentence; error.dataset.held = "1"; text.setAttribute("aria-invalid", "true"); },
      clear: () => { error.textContent = ""; delete error.dataset.held; text.removeAttribute("aria-invalid"); },
    };
  }
}

// At most one call in a while, and the last one always.
function spaced(call) {
  let waiting = null, last = 0;
  return () => {
    clearTimeout(waiting);
    const left = EACH - (performance.now() - last);
    const now = () => { last = performance.now(); call(); };
    if (left <= 0) now();
    else waiting = setTimeout(now, left);
  };
}
