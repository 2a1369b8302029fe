// The table of numbers: now, held at a place, in a trial and in the steady state of a tube; under what is held its range over
// the poses that are possible; the stated error in words.

import { element, figure, inUnit, span, unitText } from "./format.js";
import { capital } from "./plots.js";

const RELEASED = { trial: "released, 60 s of waiting, mean over 20 s with the motor on", steady: "what the released robot approaches" };

export class Numbers {
  constructor(holder) {
    this.holder = holder;
    this.cells = {};
    this.built = "";
  }

  show(lane, quantities) {
    const told = JSON.stringify([lane.numbers, lane.caution, lane.trouble, lane.warnings, lane.swims_by, lane.provisional, lane.preparing, lane.generation]);
    if (told === this.built) return;
    this.built = told;
    const numbers = lane.numbers;
    if (!numbers && !lane.trouble && this.table) {
      this.blank();
      return;
    }
    this.quantities = quantities;
    this.cells = {};
    const columns = Object.entries(numbers?.columns ?? {});
    const body = element("tbody");
    for (const [name, row] of Object.entries(numbers?.rows ?? {})) {
      const quantity = quantities[name];
      if (row.value === null) continue;
      const now = element("td", { class: "now", text: "" });
      this.cells[name] = now;
      const ranged = row.low !== null && Math.abs(row.high - row.low) > 1e-9 * Math.abs(row.value || 1);
      body.append(element("tr", { title: quantity.meaning, "data-quantity": name },
        element("th", { scope: "row", rowspan: ranged ? 2 : 1 }, capital(quantity.label), element("small", { text: ` ${unitText(quantity.unit)}` })),
        now,
        element("td", { class: "steady", text: inUnit(row.value, quantity), "data-value": row.value }),
        ...columns.map(([, column]) => element("td", { class: column ? "steady" : "steady soft", text: !column ? "\u2026" : column.rows[name] === null ? "\u2013" : inUnit(column.rows[name], quantity) })),
      ));
      if (ranged) body.append(element("tr", {}, element("td", { class: "range", colspan: 2, text: span(row.low * quantity.factor, row.high * quantity.factor) })));
    }
    const table = numbers && element("table", {},
      element("thead", {}, element("tr", {},
        element("th", { scope: "col", text: "" }),
        element("th", { scope: "col", text: "now", title: "at this moment of the run" }),
        element("th", { scope: "col", title: `steady swimming in axial motion at a fixed pose, as predicted by predict${numbers?.band ? "; under it the least and largest over the gaps and pitches that are possible" : ""}` },
          "held", numbers?.band ? element("small", { text: "range" }) : null),
        ...columns.map(([name, column]) => element("th", { scope: "col", text: name, title: `${RELEASED[name]}: ${column ? column.title : "computing \u2026"}` })),
      )), body);
    this.table = table;
    this.tag = element("span", { class: "tag", text: numbers ? `${lane.provisional ? "provisional: " : ""}model ${numbers.model}` : "computing \u2026", title: numbers?.reason ?? "" });
    this.holder.replaceChildren(
      element("h2", {}, "Numbers", this.tag),
      ...(lane.trouble ? [element("p", { class: "trouble", role: "alert", text: sentence(lane.trouble) })] : []),
      ...(numbers ? [table, words(numbers, lane)] : lane.trouble ? [] : [element("p", { class: "soft", text: "Computing \u2026" })]),
    );
  }

  // The rows stay where they are, without what was computed for another robot or setting.
  blank() {
    this.tag.textContent = "computing \u2026";
    this.tag.title = "";
    for (const cell of this.table.querySelectorAll("td")) {
      cell.textContent = cell.classList.contains("steady") ? "\u2013" : "";
      delete cell.dataset.value;
    }
    this.holder.querySelector(".said")?.remove();
  }

  now(values) {
    for (const [name, cell] of Object.entries(this.cells)) {
      cell.textContent = values && values[name] !== undefined ? inUnit(values[name], this.quantities[name]) : "";
    }
  }
}

function words(numbers, lane) {
  const list = element("div", { class: "said" });
  const error = numbers.error === null ? "" : `Error of the speed ${figure(100 * numbers.error, 2)} %${numbers.against ? `, against ${numbers.against}` : ""}. `;
  list.append(element("p", {}, element("b", { text: "Accuracy: " }), error + capital(numbers.statement) + (numbers.statement ? "." : "")));
  const more = [lane.caution, ...lane.warnings, ...numbers.warnings].filter((text, k, all) => text && all.indexOf(text) === k);
  if (numbers.band) more.push("held and range are for axial motion at a fixed pose; the robot in the picture sinks, tilts and yaws, and may swim outside the range");
  if (numbers.others) more.push(numbers.others);
  if (more.length) {
    list.append(element("details", {}, element("summary", { text: `Cautions (${more.length})` }), ...more.map((text) => element("p", { text: sentence(text) }))));
  }
  return list;
}

function sentence(text) {
  const whole = capital(text.trim());
  return /[.!?]$/.test(whole) ? whole : `${whole}.`;
}
