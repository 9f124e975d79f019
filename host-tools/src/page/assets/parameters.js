// The autopilot's parameters: those that changed first, then all, by name.

import { el } from "./elements.js";
import { flight } from "./flight.js";
import { cells, rows } from "./layout.js";
import { clock, plural, short } from "./text.js";

const course = (values) =>
  values.map(([at, value], i) => (i ? `${short(value)} at ${clock(at - flight.start)}` : short(value))).join(" \u2192 ");
const table = (parameters) =>
  rows(
    [["Parameter"], ["Value"]],
    parameters.map(([name, values]) => cells([name, course(values)], ["t", "words"], { class: values.length > 1 ? "changed" : "" })),
  );

export const parameters = () => {
  const changed = el("div"),
    all = el("div", { class: "scroll tall" }),
    count = el("summary");
  const wanted = el("input", { type: "search", placeholder: "name", "aria-label": "Parameters whose name has this in it" });
  const list = el("details", {}, count, wanted, all);
  const none = el("p", { class: "dim" }, "No parameter was told. A link tells them when a ground station asks for them.");
  let drawn = "";
  const fill = () => {
    const part = wanted.value.toUpperCase();
    if (list.open) all.replaceChildren(table([...flight.parameters].filter(([name]) => name.toUpperCase().includes(part))));
  };
  wanted.addEventListener("input", fill);
  list.addEventListener("toggle", fill);
  return {
    node: el("div", { class: "panel scroll" }, none, changed, list),
    update() {
      const other = [...flight.parameters].filter(([, values]) => values.length > 1),
        key = `${flight.parameters.size} ${JSON.stringify(other)}`;
      if (key === drawn) return;
      drawn = key;
      none.hidden = flight.parameters.size > 0;
      list.hidden = !none.hidden;
      changed.replaceChildren(other.length ? table(other) : el("p", { class: "dim", hidden: !flight.parameters.size }, "None changed."));
      const left = flight.parametersLeftOut ? `; ${plural(flight.parametersLeftOut, "value")} of others not kept` : "";
      count.textContent = `All ${plural(flight.parameters.size, "parameter")}${left}`;
      fill();
    },
  };
};
