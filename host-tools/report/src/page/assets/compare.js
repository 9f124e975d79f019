// Flights side by side: figures, findings, tracks and parameters in columns; and in one plot for each quantity, from take-off on.

import { line, whenColoursChange } from "./colours.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { bar, cells, isFramed, rows, section } from "./layout.js";
import { extent, map } from "./map.js";
import { charts } from "./plot.js";
import { plots } from "./plots.js";
import { counted, fixed, moment, plural, short, span } from "./text.js";
import { back, cursorTime, home, usually } from "./view.js";

const data = JSON.parse(document.getElementById("data").textContent);
const root = document.documentElement;
const { flights } = data;
const one = new Set(flights.map(({ airframe }) => airframe)).size === 1;
const NAME_MAX = 34;
const brief = (name) => (name.length > NAME_MAX ? `\u2026${name.slice(1 - NAME_MAX)}` : name);

flight.take(data.flight);
// Times count from each flight's take-off.
flight.start = 0;
flight.end = Math.max(...flights.map(({ from_s, to_s }) => to_s - from_s), 1);
document.title = `${plural(flights.length, "flight")} side by side`;
document
  .getElementById("head")
  .append(
    el("h1", {}, `${plural(flights.length, "flight")} side by side`),
    el("p", { class: "dim" }, `${one ? "" : "Of different airframes, as far as they tell. "}Times count from each flight's take-off.`),
  );
bar.append(back);

// ---- Tracks: each on a map of its own, and all of one scale.
const extents = flights.map(({ track }) => (track.length ? extent(track) : null));
const frame = () => {
  const drawn = extents.filter((known, number) => known && shown[number]);
  const most = (of) => Math.max(0, ...drawn.map(of));
  return {
    wide: most(({ wide }) => wide),
    tall: most(({ tall }) => tall),
    heights: [Math.min(...drawn.map(({ heights }) => heights[0])), Math.max(...drawn.map(({ heights }) => heights[1]))],
  };
};
const maps = flights.map(({ name, track, findings, from_s: from, to_s: to, landed }, number) =>
  extents[number]
    ? map({
        id: `map-${number}`,
        name: `Track of ${name}, north is up`,
        frame,
        whose: {
          track,
          notes: findings.map(([at_s, level]) => ({ kind: "finding", level, at_s })),
          flights: [{ from_s: 0, to_s: to - from, landed }],
          step: Math.max(flight.step, (to - from) / track.length),
          version: 0,
        },
      })
    : null,
);

// ---- Which of them are drawn.
const shown = flights.map(() => true);
const show = (number, on) => {
  shown[number] = on;
  for (const chart of charts) chart.show(number, on);
  tracks[number].hidden = !on;
  // The others may be larger now.
  for (const track of maps) track?.update(null, true);
};
const mark = (number) => {
  const node = el("i", { class: "flight-mark" });
  const paint = () => {
    node.style.background = line(number);
  };
  paint();
  whenColoursChange(paint);
  return node;
};
const choice = (name, number) => {
  const box = el("input", {
    type: "checkbox",
    checked: true,
    "aria-label": `Draw ${name}`,
    onchange: () => show(number, box.checked),
  });
  return box;
};
const title = ({ name, page }) =>
  page && !isFramed ? el("a", { href: encodeURIComponent(page), title: name }, brief(name)) : el("span", { title: name }, brief(name));

// ---- Figures: what is of the flight, and the extremes of what it told.
const low = (id) => (number) => flight.extremes(id, number)?.[0];
const high = (id) => (number) => flight.extremes(id, number)?.[1];
// Of all that a plot is of: of the motors the fastest.
const most = (best, of) => (plot) => (number) => {
  const ids = [...flight.plots.keys()].filter((id) => id.startsWith(`${plot}-`));
  const values = ids.map((id) => of(id)(number)).filter((value) => value != null);
  return values.length ? best(...values) : null;
};
const highest = most(Math.max, high);
const lowest = most(Math.min, low);
// Two autopilots measure these on different scales.
const autopilots = new Set(flights.map(({ vehicle }) => vehicle?.split(" ")[0]));
const unit = (plot) => [...flight.plots.values()].find(({ id }) => id.startsWith(`${plot}-`) || id === plot)?.unit ?? "";
const FIGURES = [
  ["Greatest height", "m", 1, (number) => flights[number].height_max_m],
  ["Farthest from take-off", "m", 0, (number) => extents[number]?.far],
  ["Greatest ground speed", "m/s", 1, (number) => flights[number].speed_max_m_s],
  ["Strongest wind", "m/s", 1, highest("Wind")],
  ["Lowest voltage, battery 1", "V", 2, low("PackVolts-0")],
  ["Lowest cell", "V", 3, lowest("CellVolts")],
  ["Highest current, battery 1", "A", 1, high("PackAmperes-0")],
  ["Hottest battery", "\u00b0C", 1, highest("PackCelsius")],
  ["Fastest motor", "rpm", 0, highest("MotorRpm")],
  ["Hottest ESC", "\u00b0C", 1, highest("MotorCelsius")],
  ["Highest vibration", unit("Vibration"), 2, highest("Vibration")],
  ["EKF, worst figure", unit("Estimator"), 2, highest("Estimator")],
  ["Fewest satellites, GPS 1", "", 0, low("Satellites-0")],
  ["Highest processor load", "%", 0, high("Load-0")],
];
const ended = ({ landed, disarmed_in_air: disarmed, impact_s: impact, down_s: down }) => {
  if (landed) return "landed";
  if (disarmed) return "disarmed in the air";
  return impact != null ? "an impact" : down != null ? "a mishap" : "landing not seen";
};
const count = ({ findings }, level) => findings.filter(([, known]) => known === level).length;
const FACTS = [
  ["Take-off, UTC", ({ start_utc: utc }) => (utc == null ? "not known" : `${utc.slice(0, 10)} ${utc.slice(11, 19)}`)],
  ["Vehicle", ({ vehicle, airframe }) => [vehicle, one ? null : airframe].filter(Boolean).join(", ") || "not known"],
  ["In the air", ({ air_s: air }) => span(air)],
  ["End", ended],
  ["Battery", ({ percent_from: from, percent_to: to }) => (from == null || to == null ? "" : `${fixed(from, 0)} \u2192 ${fixed(to, 0)} %`)],
  [
    "Findings",
    (f) =>
      ["critical", "warning"]
        .map((level) => (count(f, level) ? counted(count(f, level), level) : ""))
        .filter(Boolean)
        .join(", ") || "none",
  ],
];
const columns = (first) => [[first], ...flights.map((f, i) => [el("span", { class: "column" }, mark(i), title(f)), "n"])];
const figures = FIGURES.map(([name, unit, decimals, of]) => [name, flights.map((_, i) => of(i)), unit, decimals]).filter(
  ([name, values]) =>
    values.some((value) => value != null && Number.isFinite(value)) && (autopilots.size === 1 || !/vibration|EKF/.test(name)),
);
const table = section("figures", "Figures");
table.append(
  el("p", { class: "dim" }, "From take-off to the flight's end; the page of a recording tells those of all of it."),
  el(
    "div",
    { class: "panel scroll" },
    rows(
      columns(""),
      [
        el("tr", {}, el("th", { scope: "row" }, "Draw"), ...flights.map((f, i) => el("td", { class: "n" }, choice(f.name, i)))),
        ...FACTS.map(([name, of]) => cells([name, ...flights.map(of)], ["", ...flights.map(() => "n")])),
        ...figures.map(([name, values, unit, decimals]) =>
          cells(
            [name, ...values.map((value) => (value == null ? "" : `${fixed(value, decimals)} ${unit}`.trim()))],
            ["", ...flights.map(() => "n")],
          ),
        ),
      ],
      { class: "compared" },
    ),
  ),
);

const found = section("findings", "Findings");
found.append(
  el(
    "div",
    { class: "columns" },
    flights.map((f, i) =>
      el(
        "div",
        { class: "panel" },
        el("h3", {}, mark(i), brief(f.name)),
        f.findings.length
          ? el(
              "ol",
              { class: "found" },
              f.findings.map(([at, level, words]) =>
                el("li", {}, el("time", {}, moment(at)), el("span", { class: `badge ${level}` }, level), words),
              ),
            )
          : el("p", { class: "dim" }, "No warning, nothing critical."),
        f.findings_count > f.findings.length ? el("p", { class: "dim" }, `and ${f.findings_count - f.findings.length} more`) : null,
      ),
    ),
  ),
);

const tracks = flights.map((f, i) =>
  el(
    "div",
    { class: "panel" },
    el("h3", {}, mark(i), brief(f.name)),
    maps[i] ? [maps[i].node, maps[i].legend] : el("p", { class: "dim" }, "It never told where it was."),
  ),
);
section("tracks", "Tracks").append(
  el("p", { class: "dim" }, "All in one scale, and of one height in one colour; each stands in the middle of its own map."),
  el("div", { class: "columns" }, tracks),
);

usually(() => [flight.start, flight.end]);
plots((group) => section(group.toLowerCase(), group)).update();
section("parameters", "Parameters that differ").append(
  data.parameters.length
    ? el(
        "div",
        { class: "panel scroll" },
        rows(
          columns("Parameter"),
          data.parameters.map(([name, values]) =>
            cells([name, ...values.map((value) => (value == null ? "not told" : short(value)))], ["t", ...flights.map(() => "n")]),
          ),
        ),
      )
    : el("p", { class: "dim" }, "None: what more than one of them told is the same in all."),
);
document.getElementById("foot").append(`Made by hums ${data.version}. Plots: uPlot, MIT.`, cursorTime);
addEventListener("keydown", (event) => event.key === "Escape" && home());
for (const chart of charts) chart.draw();
root.dataset.ready = "true";
