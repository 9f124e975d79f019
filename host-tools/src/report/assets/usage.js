// What the vehicle was used for, and what is due.

import { log } from "./data.js";
import { el } from "./elements.js";
import { css, fixed, span, whole } from "./format.js";
import { cells, rows, section } from "./layout.js";
import { words } from "./text.js";

const { usage } = log;
const UNITS = [["_m_s2", "m/s\u00b2", 2], ["_m_s", "m/s", 2], ["_percent", "%", 1], ["_ohm", "\u03a9", 4], ["_g", "g", 2], ["_s", "s", 0], ["_m", "m", 0], ["_ah", "Ah", 3], ["_wh", "Wh", 2], ["_a", "A", 2], ["_v", "V", 2]];
const counter = (key, v) => {
  const cycles = /^load_cycles_from_(\d+(?:_\d+)?)_g$/.exec(key);
  if (cycles) return [`Load cycles of ${cycles[1].replace("_", ".")} g and more`, whole(v)];
  const unit = UNITS.find(([ending]) => key.endsWith(ending));
  if (!unit) return [words(key), Number.isInteger(v) ? whole(v) : fixed(v, 2)];
  const title = words(key.slice(0, -unit[0].length));
  return [title, unit[1] === "s" ? `${span(v)} (${whole(v)} s)` : `${fixed(v, unit[2])} ${unit[1]}`];
};
const COMPONENT = { green: "ok", yellow: "warning", red: "critical" };
const meter = (percent, status) => {
  const inner = el("i"), outer = el("span", { class: "meter" }, inner);
  inner.style.width = `${Math.min(Math.max(percent, 0), 100)}%`;
  inner.style.background = css("--" + (COMPONENT[status] ?? "stale"));
  return outer;
};

const parts = (wear) => {
  wear.append(el("div", { class: "panel scroll", id: "components" }, rows(
    [["Part"], ["Serial number"], ["Used"], ["State"], ["In the air", "n"], ["Turning", "n"], ["Flights", "n"], ["Cycles", "n"]],
    [...log.components].sort((x, y) => (y.used_percent ?? -1) - (x.used_percent ?? -1)).map((c) => cells([
      `${words(c.kind)}${c.number ? " " + c.number : ""}${c.name ? " \u00b7 " + c.name : ""}`, c.serial,
      c.used_percent == null ? "no limit" : el("span", { class: "used" }, meter(c.used_percent, c.status), `${fixed(c.used_percent, 1)} %`),
      el("span", { class: `badge ${COMPONENT[c.status] ?? "stale"}` }, c.used_percent >= 100 ? "due" : c.status),
      `${fixed(c.flight_s / 3600, 2)} h`, `${fixed(c.motor_s / 3600, 2)} h`, whole(c.flights), fixed(c.cycles, 2),
    ], ["", "t", "", "t", "n", "n", "n", "n"])))));
};

const exceeded = (wear) => {
  const exceeded = log.exceedances.filter((e) => e.session.warnings || e.session.criticals || e.lifetime.warnings || e.lifetime.criticals);
  if (!exceeded.length) return;
  const times = (count, seconds) => count ? `${whole(count)} \u00d7, ${fixed(seconds, 1)} s` : "";
  const peak = (e, of) => e[of].peak == null ? "" : `${Number(e[of].peak.toPrecision(4))} ${e.unit}`;
  wear.append(el("h3", { class: "above" }, "Limits exceeded"), el("div", { class: "panel scroll" }, rows(
    [["Check"], ["Warning", "n"], ["Critical", "n"], ["Peak", "n"], ["Warning, in its life", "n"], ["Critical, in its life", "n"], ["Peak, in its life", "n"]],
    exceeded.map((e) => cells([`${words(e.check)}${e.instance ? " " + (e.instance + 1) : ""}`,
      times(e.session.warnings, e.session.warning_s), times(e.session.criticals, e.session.critical_s), peak(e, "session"),
      times(e.lifetime.warnings, e.lifetime.warning_s), times(e.lifetime.criticals, e.lifetime.critical_s), peak(e, "lifetime")],
    ["", "n", "n", "n", "n", "n", "n"])))));
};

const counters = (wear, names) => {
  const life = log.lifetime;
  const lived = Object.keys(life).length > 0;
  const motors = {}, plain = [], bands = {};
  for (const key of names) {
    const motor = /^motor(\d+)_(run_time_s|revolutions)$/.exec(key);
    const band = /^(.*?)_(?:below_([\d_]+)|from_([\d_]+)|(-?[\d_]+)_to_([\d_]+))_([a-z].*)_s$/.exec(key);
    if (motor) (motors[motor[1]] ??= {})[motor[2]] = key;
    else if (band) (bands[band[1]] ??= []).push([band, usage[key]]);
    else plain.push(cells([...counter(key, usage[key]), life[key] == null ? "" : counter(key, life[key])[1]], ["", "n", "n"]));
  }
  const heading = ["This session", "n"], ever = ["In its life", "n"];
  const numbers = Object.keys(motors).map(Number).sort((x, y) => x - y);
  const ofMotor = (from, m, name) => {
    const v = from[motors[m][name]];
    return v == null ? "" : name === "revolutions" ? whole(v) : span(v);
  };
  const motorTable = rows([["Motor"], ["Run time", "n"], ["Revolutions", "n"], ...(lived ? [["Run time, in its life", "n"], ["Revolutions, in its life", "n"]] : [])],
    numbers.map((m) => cells([m + 1, ofMotor(usage, m, "run_time_s"), ofMotor(usage, m, "revolutions"),
      ...(lived ? [ofMotor(life, m, "run_time_s"), ofMotor(life, m, "revolutions")] : [])], ["", "n", "n", "n", "n"])));
  const number = (text) => Number(text.replace("_", "."));
  const histograms = Object.entries(bands).map(([name, list]) => {
    const sum = list.reduce((all, [, v]) => all + v, 0);
    if (sum === 0) return null;
    const edge = (band) => band[2] != null ? -Infinity : number(band[3] ?? band[4]);
    const unit = { m_s2: "m/s\u00b2", m_s: "m/s", degc: "\u00b0C", percent: "%", a: "A", v: "V", g: "g", rpm: "rpm" };
    const body = list.sort((x, y) => edge(x[0]) - edge(y[0])).map(([band, v]) => {
      const u = unit[band[6]] ?? words(band[6]);
      const text = band[2] != null ? `below ${number(band[2])} ${u}` : band[3] != null ? `from ${number(band[3])} ${u}` : `${number(band[4])} to ${number(band[5])} ${u}`;
      const inner = el("i"), bar = el("span", { class: "meter wide" }, inner);
      inner.style.width = `${v / sum * 100}%`;
      return cells([text, bar, v ? `${fixed(v / sum * 100, v / sum < 0.1 ? 1 : 0)} %` : "", v ? span(v) : ""], ["t", "", "n", "n"]);
    });
    return el("div", { class: "panel scroll" }, el("h3", {}, words(name)), el("table", {}, el("tbody", {}, body)));
  }).filter(Boolean);
  wear.append(el("h3", { class: "above" }, "Counters"), el("div", { class: "split" },
    el("div", { class: "panel scroll tall" }, rows([["Counter"], heading, ever], plain)),
    numbers.length ? el("div", { class: "panel scroll" }, motorTable) : null));
  if (histograms.length) wear.append(el("h3", { class: "above" }, "Time spent in ranges"), el("div", { class: "split" }, histograms));
};

export const usageSection = () => {
  const wear = section("usage", "Usage and what is due");
  if (log.components.length) parts(wear);
  exceeded(wear);
  const names = Object.keys(usage);
  if (names.length) counters(wear, names);
  else {
    wear.append(el("p", { class: "dim" }, "This log has no usage counters: it was packed from a recording, or it ended before the first."));
  }
};
