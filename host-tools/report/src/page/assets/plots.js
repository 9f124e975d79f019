// All plots of the flight, by group, in the order that hums gives them.

import { el } from "./elements.js";
import { flight } from "./flight.js";
import { chart } from "./plot.js";

// No line changes: such plots fold away in a whole flight.
const isFlat = (id) =>
  flight.lines(id).every(([number]) => {
    const [low, high] = flight.extremes(id, number);
    return low === high;
  });

// `place` gives a group's section, before that of the next group where there is one already; what is shown elsewhere is left out.
export const plots = (place, { elsewhere = [], folds = false } = {}) => {
  const groups = new Map(),
    folded = new Map(),
    made = new Map();
  // The plots of a group that never change, behind a line that names them.
  const fold = (group, one, title) => {
    if (!folded.has(group)) {
      const names = el("span"),
        list = el("div", { class: "plots" });
      const node = el("details", { class: "flat" }, el("summary", {}, "Never changes: ", names), list);
      groups.get(group).parentElement.append(node);
      folded.set(group, { names, list });
    }
    const { names, list } = folded.get(group);
    names.textContent += `${names.textContent && ", "}${title}`;
    list.append(one.node);
  };
  return {
    // A plot is there as soon as it has a line.
    update() {
      for (const { id, group, title } of flight.plots.values()) {
        if (made.has(id) || elsewhere.includes(id) || !flight.lines(id).length) continue;
        if (!groups.has(group)) {
          const all = [...new Set([...flight.plots.values()].map((plot) => plot.group))],
            next = all.slice(all.indexOf(group) + 1).find((later) => groups.has(later));
          groups.set(group, el("div", { class: "plots" }));
          place(group, next ? groups.get(next).parentElement : null).append(groups.get(group));
        }
        const one = chart(id),
          order = [...flight.plots.keys()];
        made.set(id, one);
        if (folds && isFlat(id)) {
          fold(group, one, title);
          continue;
        }
        const next = [...groups.get(group).children].find((node) => order.indexOf(node.id.slice("plot-".length)) > order.indexOf(id));
        groups.get(group).insertBefore(one.node, next ?? null);
      }
      for (const [id, one] of made) one.node.hidden = !flight.plots.has(id);
    },
  };
};
