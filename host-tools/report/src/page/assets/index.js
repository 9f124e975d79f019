// The pages of a folder: a table that is sorted by any of its columns, and narrowed by a word.

import { el } from "./elements.js";
import { bar, main } from "./layout.js";
import { sorted } from "./sorted.js";
import { counted, fixed, plural, span } from "./text.js";

const { pages, comparisons, version } = JSON.parse(document.getElementById("data").textContent);
const root = document.documentElement;
document.title = `HUMS flights: ${plural(pages.length, "page")}`;
document
  .getElementById("head")
  .append(el("h1", {}, "Flights"), el("p", { class: "dim" }, `${plural(pages.length, "recording")} in this folder, by hums ${version}.`));
bar.parentElement.hidden = true;

const when = (utc) => (utc == null ? "time not known" : `${utc.slice(0, 10)} ${utc.slice(11, 19)}`);
const RANK = { critical: 3, warning: 2, stale: 1, ok: 0 };
const worst = ({ critical, warning, checked, little }) =>
  critical ? "critical" : warning ? "warning" : checked && !little ? "ok" : "stale";
const found = (page) =>
  ["critical", "warning"]
    .filter((level) => page[level])
    .map((level) => counted(page[level], level))
    .join(", ") || (!page.checked ? "not checked" : page.little ? "not enough to judge" : "no findings");
const verdict = (page) => `${found(page)}${page.begins_in_air ? "; begins in the air" : ""}${page.ends_in_air ? "; ends in the air" : ""}`;
// Sessions of two cards may have one name: the file's names the box too.
const called = ({ name, file }) => (pages.filter((page) => page.name === name).length > 1 ? file.replace(/\.html$/, "") : name);
const brief = (name) => (name.length > 48 ? `\u2026${name.slice(-47)}` : name);
const COLUMNS = [
  ["Begin, UTC", "t", ({ start_utc }) => start_utc ?? "", ({ start_utc }) => when(start_utc)],
  ["Recording", "words", called, (page) => el("a", { href: encodeURIComponent(page.file) }, brief(called(page)))],
  [
    "Findings",
    "t",
    (page) => RANK[worst(page)] * 1e6 + page.critical * 1e3 + page.warning,
    (page) => el("span", { class: `badge ${worst(page)}` }, verdict(page)),
  ],
  ["Vehicle", "words", ({ vehicle }) => vehicle ?? "", ({ vehicle }) => vehicle ?? "not known"],
  ["Airframe", "words", ({ airframe }) => airframe ?? "", ({ airframe }) => airframe ?? ""],
  ["Length", "n", ({ duration_s }) => duration_s ?? -1, ({ duration_s }) => span(duration_s)],
  ["Flights", "n", ({ flights }) => flights, (page) => (page.flight_unknown ? "not known" : String(page.flights))],
  ["In the air", "n", ({ air_s }) => air_s, (page) => (page.flight_unknown ? "" : span(page.air_s))],
  [
    "Height",
    "n",
    ({ height_max_m }) => height_max_m ?? -1,
    ({ height_max_m }) => (height_max_m == null ? "" : `${fixed(height_max_m, 1)} m`),
  ],
  [
    "Speed",
    "n",
    ({ speed_max_m_s }) => speed_max_m_s ?? -1,
    ({ speed_max_m_s }) => (speed_max_m_s == null ? "" : `${fixed(speed_max_m_s, 1)} m/s`),
  ],
  ["Recording is", "words", ({ faults }) => faults.length, ({ faults }) => faults.join("; ") || "whole"],
];

main.append(
  ...sorted("pages", pages, COLUMNS, { placeholder: "vehicle, name, date", label: "Only recordings that have this in their row" }),
  comparisons.length
    ? el(
        "div",
        { class: "panel", id: "comparisons" },
        el("h3", {}, "The last flights side by side"),
        el(
          "ul",
          {},
          comparisons.map(([airframe, file]) => el("li", {}, el("a", { href: encodeURIComponent(file) }, airframe))),
        ),
      )
    : "",
);
root.dataset.ready = "true";
