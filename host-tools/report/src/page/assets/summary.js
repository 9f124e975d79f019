// The session at a glance: figures, identity, flights.

import { data, log, name } from "./data.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { cells, facts, rows, section } from "./layout.js";
import { fixed, moment, plural, span, whole } from "./text.js";
import { utc } from "./view.js";

const { usage, vehicle } = log;
const tile = (value, unit, label) =>
  value == null ? null : el("div", { class: "tile" }, el("b", {}, value, unit ? el("span", {}, unit) : null), el("small", {}, label));
const tiles = () => {
  const flown = data.flights.reduce((sum, f) => sum + f.air_s, 0);
  const within = ({ from_s, to_s }, [from, to]) => Math.max(Math.min(to, to_s) - Math.max(from, from_s), 0);
  const lacks = data.flights.reduce((sum, f) => flight.gaps.reduce((sum, gap) => sum + within(f, gap), sum), 0);
  const peak = (id) => flight.extremes(id, 0)?.[1];
  const low = (id) => flight.extremes(id, 0)?.[0];
  const of = (value, decimals) => (value == null || !Number.isFinite(value) ? null : fixed(value, decimals));
  const battery = data.flights.length ? data.flights[data.flights.length - 1] : null;
  return el(
    "div",
    { class: "tiles" },
    tile(
      data.flights.length || data.tells_flight ? span(flown) : "\u2013",
      "",
      data.tells_flight
        ? plural(data.flights.length, "flight") + (lacks >= 1 ? `, without ${span(lacks)} not in the record` : "")
        : "in the air: not known",
    ),
    tile(of(usage.distance_m, 0), "m", "over ground in the air"),
    tile(of(usage.height_max_m ?? peak("Height"), 1), "m", "greatest height"),
    tile(of(usage.speed_max_m_s ?? peak("Speed"), 1), "m/s", "greatest ground speed"),
    tile(of(low("PackVolts"), 2), "V", "lowest battery voltage"),
    tile(of(peak("PackAmperes"), 1), "A", "highest battery current, on the ground too"),
    battery && battery.percent_to != null && data.flights[0].percent_from != null
      ? tile(`${of(data.flights[0].percent_from, 0)} \u2192 ${of(battery.percent_to, 0)}`, "%", "battery in flight")
      : null,
    tile(of(usage.vibration_max_m_s2, 1), "m/s\u00b2", "highest vibration"),
    log.frames ? tile(whole(log.frames), "", "frames recorded") : null,
    log.format === "hums" && log.frames ? tile(fixed(log.ratio, 1), "\u00d7", "smaller than a tlog") : null,
  );
};

// To the second: a card and a ground station's log of one flight tell it by two clocks.
const day = (utc) =>
  utc ? `\u00b7 ${utc.slice(0, 10)} ${utc.slice(11, 19)} UTC by the ${log.format === "tlog" ? "ground station's" : "vehicle's"} clock` : "";

const identity = () =>
  facts([
    ["Vehicle", name],
    ["System", vehicle && `${vehicle.system}, component ${vehicle.component}`],
    ["Autopilot's id", vehicle?.uid],
    ["From", `${moment(flight.start - flight.zero)} ${day(log.start_utc)}`],
    ["To", `${moment(flight.end - flight.zero)} ${day(log.end_utc)}`],
    [
      "Monitor",
      log.monitor &&
        `${log.monitor.version} ${log.monitor.git} on ${log.monitor.board}, started by ${log.monitor.reset}, start ${log.monitor.boots}`,
    ],
    ["Session id", log.session],
    ["Files", log.files.join(", ")],
  ]);

// When it landed, or how the flight ended otherwise.
const landing = (f) => {
  const time = (s) => utc(s) || moment(s - flight.zero),
    at = time(f.to_s);
  if (f.landed) return at;
  if (f.disarmed_in_air) return `disarmed in the air, ${at}`;
  if (f.impact_s != null) return `ended by an impact, ${time(f.impact_s)}`;
  if (f.down_s != null) return `ended by a mishap, ${time(f.down_s)}`;
  return flight.end - f.to_s < 5 ? "in the air at the end" : `not seen, last in the air ${at}`;
};

const TITLES = ["#", "Take-off", "Landing", "Time", "Height", "Speed", "Battery"];
const KINDS = ["n", "t", "t", "n", "n", "n", "n"];
const flights = (go) =>
  data.flights.length
    ? rows(
        TITLES.map((title, i) => [title, KINDS[i]]),
        data.flights.map((f, i) =>
          cells(
            [
              i + 1,
              f.took_off ? utc(f.from_s) || moment(f.from_s - flight.zero) : "in the air at the beginning",
              landing(f),
              span(f.air_s),
              f.height_max_m == null ? "" : `${fixed(f.height_max_m, 1)} m`,
              f.speed_max_m_s == null ? "" : `${fixed(f.speed_max_m_s, 1)} m/s`,
              f.percent_from != null && f.percent_to != null ? `${fixed(f.percent_from, 0)} \u2192 ${fixed(f.percent_to, 0)} %` : "",
            ],
            KINDS,
            {
              class: "go",
              tabindex: 0,
              onclick: () => go(f.from_s, f.to_s),
              onkeydown: (e) => e.key === "Enter" && go(f.from_s, f.to_s),
            },
            TITLES,
          ),
        ),
      )
    : el(
        "p",
        { class: "dim" },
        data.tells_flight
          ? "The vehicle was not in the air."
          : "Whether it was in the air is not known: nothing in this recording tells of height, speed or landing.",
      );

export const summary = (go) => {
  const host = section("summary", "Summary");
  host.append(tiles());
  host.append(
    el(
      "div",
      { class: "split" },
      el("div", { class: "panel scroll" }, identity()),
      el("div", { class: "panel scroll cards", id: "flights" }, flights(go)),
    ),
  );
};
