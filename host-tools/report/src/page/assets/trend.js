// This session against those before it.

import { data, log } from "./data.js";
import { el, svg } from "./elements.js";
import { cells, rows, section } from "./layout.js";
import { fixed, plural, span } from "./text.js";

const spark = (values) => {
  const known = values.filter((v) => v != null);
  const low = Math.min(...known),
    high = Math.max(...known);
  const node = svg("svg", { class: "spark", viewBox: "0 0 150 26", "aria-hidden": "true" });
  const x = (i) => 5 + (i / Math.max(values.length - 1, 1)) * 140;
  const y = (v) => (high === low ? 13 : 22 - ((v - low) / (high - low)) * 18);
  const path = values.map((v, i) => (v == null ? null : `${x(i).toFixed(1)},${y(v).toFixed(1)}`)).filter(Boolean);
  node.append(svg("polyline", { points: path.join(" "), fill: "none", stroke: "currentColor", "stroke-width": 1.5, opacity: 0.6 }));
  const last = values[values.length - 1];
  if (last != null) node.append(svg("circle", { cx: x(values.length - 1), cy: y(last), r: 3.5, fill: "var(--accent)" }));
  return node;
};

const show = (v, unit) => (v == null ? "" : unit === "s" ? span(v) : `${Number(v.toPrecision(4))} ${unit}`.trim());

export const trendSection = () => {
  const { trend } = data;
  if (trend.sessions.length < 2 || !trend.rows.length) return;
  const host = section("trend", "Trend");
  host.append(
    el(
      "p",
      { class: "dim" },
      `This session against the ${plural(trend.sessions.length - 1, "session")} before it on the same card, of the same vehicle.`,
    ),
    el(
      "div",
      { class: "panel scroll" },
      rows(
        [["Quantity"], [`${trend.sessions[0].name} \u2192 ${log.name}`], ["Median before", "n"], ["This session", "n"], ["Change", "n"]],
        trend.rows.map((row) => {
          const before = row.values
            .slice(0, -1)
            .filter((v) => v != null)
            .sort((a, b) => a - b);
          const median = before.length ? (before[(before.length - 1) >> 1] + before[before.length >> 1]) / 2 : null;
          const now = row.values[row.values.length - 1];
          const change = median && now != null ? (now / median - 1) * 100 : null;
          return cells(
            [
              row.title,
              spark(row.values),
              show(median, row.unit),
              show(now, row.unit),
              change == null ? "" : change >= 1000 ? "over +1000 %" : `${change >= 0 ? "+" : "\u2212"}${fixed(Math.abs(change), 0)} %`,
            ],
            ["", "", "n", "n", "n"],
          );
        }),
      ),
    ),
  );
};
