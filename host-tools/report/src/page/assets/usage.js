// What the vehicle was used for, and what is due.

import { data, log } from "./data.js";
import { el } from "./elements.js";
import { cells, rows, section } from "./layout.js";
import { fixed, span, whole, words } from "./text.js";

const COMPONENT = { green: "ok", yellow: "warning", red: "critical" };
const meter = (percent, kind) => {
  const inner = el("i");
  inner.style.width = `${Math.min(Math.max(percent, 0), 100)}%`;
  return el("span", { class: `meter ${kind}` }, inner);
};

const parts = (wear) => {
  wear.append(
    el(
      "div",
      { class: "panel scroll", id: "components" },
      rows(
        [["Part"], ["Serial number"], ["Used"], ["State"], ["In the air", "n"], ["Turning", "n"], ["Flights", "n"], ["Cycles", "n"]],
        [...log.components]
          .sort((x, y) => (y.used_percent ?? -1) - (x.used_percent ?? -1))
          .map((c) =>
            cells(
              [
                `${words(c.kind)}${c.number ? ` ${c.number}` : ""}${c.name ? ` \u00b7 ${c.name}` : ""}`,
                c.serial,
                c.used_percent == null
                  ? "no limit"
                  : el(
                      "span",
                      { class: "used" },
                      meter(c.used_percent, COMPONENT[c.status] ?? "stale"),
                      `${fixed(c.used_percent, 1)} %${c.limit ? ` of ${c.limit}` : ""}`,
                    ),
                el("span", { class: `badge ${COMPONENT[c.status] ?? "stale"}` }, c.used_percent >= 100 ? "due" : c.status),
                `${fixed(c.flight_s / 3600, 2)} h`,
                `${fixed(c.motor_s / 3600, 2)} h`,
                whole(c.flights),
                fixed(c.cycles, 2),
              ],
              ["", "t", "", "t", "n", "n", "n", "n"],
            ),
          ),
      ),
    ),
  );
};

const exceeded = (wear) => {
  const exceeded = log.exceedances.filter((e) => [e.session, e.lifetime].some((of) => of?.warnings || of?.criticals));
  if (!exceeded.length) return;
  const times = (count, seconds) => (count ? `${whole(count)} \u00d7, ${fixed(seconds, 1)} s` : "");
  const worst = (e, of) =>
    of.state ??
    (of.peak == null
      ? ""
      : `${Number(of.peak.toPrecision(4))} ${e.unit.replace("m/s2", "m/s\u00b2").replace("deg", "\u00b0").replace("times", "\u00d7 usual")}`);
  const lived = exceeded.some(({ lifetime }) => lifetime);
  const crossings = (e, of) => (of ? [times(of.warnings, of.warning_s), times(of.criticals, of.critical_s), worst(e, of)] : ["", "", ""]);
  wear.append(
    el("h3", { class: "above" }, "Limits exceeded"),
    el(
      "div",
      { class: "panel scroll" },
      rows(
        [
          ["Check"],
          ["Warning", "n"],
          ["Critical", "n"],
          ["Worst", "n"],
          ...(lived
            ? [
                ["Warning, in its life", "n"],
                ["Critical, in its life", "n"],
                ["Worst, in its life", "n"],
              ]
            : []),
        ],
        exceeded.map((e) =>
          cells([e.name, ...crossings(e, e.session), ...(lived ? crossings(e, e.lifetime) : [])], ["", "n", "n", "n", "n", "n", "n"]),
        ),
      ),
    ),
  );
};

const shown = (value, unit, decimals) =>
  value == null
    ? ""
    : unit === "s"
      ? `${span(value)} (${whole(value)} s)`
      : `${Number.isInteger(value) && !unit ? whole(value) : fixed(value, decimals)} ${unit}`.trim();
const counters = (wear, { plain, motors, ranges }) => {
  const lived = plain.some(({ life }) => life != null) || motors.some((motor) => motor.life_run_time_s != null);
  const ever = (headings) => (lived ? headings : []);
  const time = (value) => (value == null ? "" : span(value)),
    turns = (value) => (value == null ? "" : whole(value));
  const motorTable = rows(
    [
      ["Motor"],
      ["Run time", "n"],
      ["Revolutions", "n"],
      ...ever([
        ["Run time, in its life", "n"],
        ["Revolutions, in its life", "n"],
      ]),
    ],
    motors.map((m) =>
      cells(
        [m.number + 1, time(m.run_time_s), turns(m.revolutions), ...ever([time(m.life_run_time_s), turns(m.life_revolutions)])],
        ["", "n", "n", "n", "n"],
      ),
    ),
  );
  const histograms = ranges
    .map(({ title, unit, bands }) => {
      const sum = bands.reduce((all, [, , s]) => all + s, 0);
      if (sum === 0) return null;
      const body = bands.map(([from, to, s]) => {
        const text = from == null ? `below ${to} ${unit}` : to == null ? `from ${from} ${unit}` : `${from} to ${to} ${unit}`;
        return cells(
          [text, meter((s / sum) * 100, "wide"), s ? `${fixed((s / sum) * 100, s / sum < 0.1 ? 1 : 0)} %` : "", s ? span(s) : ""],
          ["t", "", "n", "n"],
        );
      });
      return el("div", { class: "panel scroll" }, el("h3", {}, words(title)), el("table", {}, el("tbody", {}, body)));
    })
    .filter(Boolean);
  const life = data.life_before ? "In its life before" : "In its life";
  wear.append(
    el("h3", { class: "above" }, "Counters"),
    ...[data.counted, data.counters.remark]
      .filter(Boolean)
      .map((words) => el("p", { class: "dim" }, `${words[0].toUpperCase()}${words.slice(1)}.`)),
    el(
      "div",
      { class: "split" },
      el(
        "div",
        { class: "panel scroll" },
        rows(
          [["Counter"], ["This session", "n"], ...ever([[life, "n"]])],
          plain.map((c) =>
            cells([c.title, shown(c.session, c.unit, c.decimals), ...ever([shown(c.life, c.unit, c.decimals)])], ["", "n", "n"]),
          ),
        ),
      ),
      motors.length ? el("div", { class: "panel scroll" }, motorTable) : "",
    ),
  );
  if (histograms.length) wear.append(el("h3", { class: "above" }, "Time spent in ranges"), el("div", { class: "split" }, histograms));
};

export const usageSection = () => {
  const wear = section("usage", "Usage and what is due");
  if (log.components.length) parts(wear);
  exceeded(wear);
  if (data.counters.plain.length) counters(wear, data.counters);
  else {
    wear.append(el("p", { class: "dim" }, "This recording has no usage counters."));
  }
};
