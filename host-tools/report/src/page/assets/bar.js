// Bars: a name, a bar from zero, a number.

import { say, toggle } from "./dom.js";
import { el } from "./elements.js";
import { fixed } from "./text.js";

export const bars = (rows) => {
  const made = rows.map(({ id, title, size, decimals = 2, unit = "", both = false }) => {
    const fill = el("i"),
      number = el("b", { "data-value": id });
    const node = el(
      "div",
      { class: `bar ${both ? "both" : ""}` },
      el("span", {}, title),
      el("div", { class: "rail" }, fill),
      el("span", { class: "n" }, number, el("small", {}, unit)),
    );
    return { node, fill, number, size, decimals, both };
  });
  return {
    node: el(
      "div",
      { class: "bars" },
      made.map((row) => row.node),
    ),
    update(values, limits) {
      made.forEach((row, i) => {
        const shown = values[i],
          v = shown?.[0];
        const part = v == null ? 0 : Math.max(-1, Math.min(1, v / row.size));
        say(row.number, fixed(v, row.decimals));
        const transform = row.both ? `scaleX(${(part / 2).toFixed(4)})` : `scaleX(${Math.max(part, 0).toFixed(4)})`;
        if (row.fill.style.transform !== transform) row.fill.style.transform = transform;
        const [warning, critical] = limits ?? [Infinity, Infinity];
        toggle(row.fill, "critical", v > critical);
        toggle(row.fill, "warning", v > warning && !(v > critical));
        toggle(row.node, "none", v == null);
        toggle(row.node, "stale", Boolean(shown?.[2]));
      });
    },
  };
};
