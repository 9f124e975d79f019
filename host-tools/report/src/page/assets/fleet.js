// A fleet: its vehicles, the parts that are due, the worst findings, and the vehicles that differ from the others.

import { el } from "./elements.js";
import { section } from "./layout.js";
import { sorted } from "./sorted.js";
import { fixed, plural, short, span, whole } from "./text.js";

const { version, fleet } = JSON.parse(document.getElementById("data").textContent);
const { vehicles, due, findings, outliers } = fleet;
const total = (of) => vehicles.reduce((sum, vehicle) => sum + of(vehicle), 0);
document.title = `HUMS fleet: ${plural(vehicles.length, "vehicle")}`;
document.getElementById("head").append(
  el("h1", {}, "Fleet"),
  el(
    "p",
    { class: "dim" },
    `${plural(vehicles.length, "vehicle")}, ${plural(fleet.sessions, "session")}, ${plural(
      total(({ flights }) => flights),
      "flight",
    )}, ${fixed(total(({ flight_s }) => flight_s) / 3600, 1)} h in the air, by hums ${version}.`,
  ),
);
const badge = (level, text) => el("span", { class: `badge ${level}` }, text);
const name = ["Vehicle", "words", ({ vehicle }) => vehicle, ({ vehicle }) => vehicle];
const kind = ["Kind", "words", ({ kind }) => kind, ({ kind }) => kind];
const unit = (value, decimals, unit) => `${decimals == null ? short(value) : fixed(value, decimals)}${unit ? ` ${unit}` : ""}`;
const table = (id, title, items, columns, by, none) => {
  const node = section(id, title);
  if (!items.length) node.append(el("p", { class: "dim" }, none));
  else
    node.append(
      ...sorted(`${id}-table`, items, columns, { by, placeholder: "vehicle, part, check", label: `${title}: only rows with this` }),
    );
  return node;
};

table(
  "due",
  "Parts that are due",
  due,
  [
    name,
    ["Part", "words", ({ part }) => part, ({ part }) => part],
    ["Serial number", "words", ({ serial }) => serial, ({ serial }) => serial],
    [
      "Used",
      "n",
      ({ used_percent }) => used_percent,
      ({ used_percent, status }) =>
        badge(status === "red" ? "critical" : "warning", `${whole(used_percent)} %, ${status === "red" ? "due" : "soon due"}`),
    ],
    ["Limit", "words", ({ limit }) => limit ?? "", ({ limit }) => limit ?? ""],
  ],
  3,
  "No part is due by the last session of its vehicle.",
);
const found = table(
  "findings",
  "Worst findings",
  findings,
  [
    ["Level", "t", ({ level, sessions }) => (level === "critical" ? 1e9 : 0) + sessions, ({ level }) => badge(level, level)],
    name,
    ["Check", "words", ({ check }) => check, ({ check }) => check],
    ["Sessions", "n", ({ sessions }) => sessions, ({ sessions }) => whole(sessions)],
    ["Last", "t", ({ day }) => day, ({ day }) => day || "not known"],
    ["Value", "n", ({ value }) => value ?? 0, (one) => one.state ?? (one.value == null ? "" : unit(one.value, null, one.unit))],
    ["Limit", "n", ({ limit }) => limit ?? 0, (one) => (one.limit == null ? "" : unit(one.limit, null, one.unit))],
    ["Session", "words", ({ session }) => session, ({ session }) => session],
  ],
  0,
  "No session has a warning or worse.",
);
if (fleet.findings_left_out)
  found.append(el("p", { class: "dim" }, `${plural(fleet.findings_left_out, "finding")} of lower rank are in the table sessions.`));
const differ = table(
  "outliers",
  "Different from the others",
  outliers,
  [
    name,
    kind,
    ["Figure", "words", ({ figure }) => figure, ({ figure }) => figure],
    ["Value", "n", ({ value }) => value, (one) => unit(one.value, one.decimals, one.unit)],
    ["Median of the kind", "n", ({ median }) => median, (one) => unit(one.median, one.decimals, one.unit)],
    ["Vehicles", "n", ({ vehicles }) => vehicles, ({ vehicles }) => whole(vehicles)],
    ["Score", "n", ({ score }) => score, ({ score }) => fixed(score, 1)],
  ],
  6,
  "No vehicle differs from the others of its kind.",
);
differ.append(
  el(
    "p",
    { class: "dim" },
    `The score is 0.6745 times the distance from the median, divided by the median distance (MAD); above 3.5 a vehicle is an outlier.${
      fleet.not_compared ? ` ${plural(fleet.not_compared, "vehicle")} of kinds with fewer than 5 vehicles: not compared.` : ""
    }`,
  ),
);
const all = table(
  "vehicles",
  "Vehicles",
  vehicles,
  [
    name,
    kind,
    ["Firmware", "words", ({ firmware }) => firmware, ({ firmware }) => firmware],
    ["Sessions", "n", ({ sessions }) => sessions, ({ sessions }) => whole(sessions)],
    ["Flights", "n", ({ flights }) => flights, ({ flights }) => whole(flights)],
    ["In the air", "n", ({ flight_s }) => flight_s, ({ flight_s }) => span(flight_s)],
    ["First", "t", ({ days }) => days[0], ({ days }) => days[0] || "not known"],
    ["Last", "t", ({ days }) => days[1], ({ days }) => days[1] || "not known"],
    ["Critical", "n", ({ critical }) => critical, ({ critical }) => whole(critical)],
    ["Warnings", "n", ({ warning }) => warning, ({ warning }) => whole(warning)],
  ],
  5,
  "The table sessions is empty.",
);
if (fleet.overlapping)
  all.append(
    el(
      "p",
      { class: "dim" },
      `${plural(fleet.overlapping, "session")} at the time of another session of the same vehicle with more time in the air: flights are summed once.`,
    ),
  );
document.documentElement.dataset.ready = "true";
