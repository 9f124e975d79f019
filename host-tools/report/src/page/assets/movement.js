// What a pilot looks at first.

import { say, panel } from "./dom.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { fixed } from "./text.js";
import { bars } from "./bar.js";
import { compass } from "./compass.js";
import { gauge } from "./gauge.js";
import { horizon } from "./horizon.js";
import { map } from "./map.js";
import { chart } from "./plot.js";

const place = () => {
  const numbers = ["latitude", "longitude"].map((id) => el("b", { "data-value": id }));
  const speed = el("b", { "data-value": "velocity_module" }),
    altitude = el("b", { "data-value": "altitude" });
  const box = panel(
    "place",
    "Position and speed",
    el(
      "dl",
      { class: "place" },
      [
        ["Latitude", numbers[0], "\u00b0"],
        ["Longitude", numbers[1], "\u00b0"],
        ["Above sea level", altitude, " m"],
        ["Speed, all directions", speed, " m/s"],
      ].map(([name, number, unit]) => el("div", {}, el("dt", {}, name), el("dd", {}, number, unit))),
    ),
    { class: "instrument" },
  );
  return {
    node: box.node,
    update({ values }) {
      box.fresh(values.latitude, values.longitude);
      say(numbers[0], fixed(values.latitude?.[0], 7));
      say(numbers[1], fixed(values.longitude?.[0], 7));
      say(altitude, fixed(values.altitude?.[0], 1));
      say(speed, fixed(values.velocity_module?.[0], 1));
    },
  };
};

const acceleration = () => {
  const part = (id, title) => ({ id, title, size: 20, both: true, unit: "m/s\u00b2" });
  const three = bars([part("accel_front", "Front"), part("accel_right", "Right"), part("accel_down", "Down")]);
  const module = el("b", { "data-value": "accel_module" });
  const sum = el("p", { class: "pair" }, el("span", {}, "Total ", module, " m/s\u00b2"));
  const box = panel("acceleration", "Acceleration", [three.node, sum], { class: "instrument" });
  return {
    node: box.node,
    update({ values }) {
      box.fresh(values.accel_module);
      three.update([values.accel_front, values.accel_right, values.accel_down]);
      say(module, fixed(values.accel_module?.[0], 2));
    },
  };
};

export const movement = () => {
  const scale = { top: 20, grows: true };
  // Name, gauge, plot with its limits.
  const gauges = [
    ["height", gauge("height", "Height", { unit: "m", scale: { top: 50, grows: true }, decimals: 1 })],
    ["airspeed", gauge("airspeed", "Air speed", { unit: "m/s", scale, decimals: 1 })],
    ["groundspeed", gauge("groundspeed", "Ground speed", { unit: "m/s", scale, decimals: 1 })],
    ["climb", gauge("climb", "Climb rate", { unit: "m/s", low: -10, high: 10, decimals: 1 })],
    ["throttle", gauge("throttle", "Throttle", { unit: "%", high: 100 })],
    ["battery_percent", gauge("battery_percent", "Battery", { unit: "%", high: 100 }), "PackPercent"],
  ];
  const views = [horizon(), compass()],
    track = map(),
    rest = [place(), acceleration()];
  const around = panel("map", "Track", [track.node, track.legend], { class: "wide" });
  const height = chart("Height", "Height above home"),
    velocity = chart("Velocity", "NED velocity");
  return {
    node: el(
      "section",
      { class: "row", id: "movement" },
      el("h2", {}, "Movement"),
      el("div", { class: "views" }, views[0].node, around.node),
      el(
        "div",
        { class: "instruments" },
        views[1].node,
        gauges.map(([, part]) => part.node),
      ),
      el(
        "div",
        { class: "pairs" },
        rest.map((part) => part.node),
      ),
      el("div", { class: "plots" }, height.node, velocity.node),
    ),
    update(state) {
      const { values } = state;
      for (const [name, part, plot] of gauges) part.update(values[name], plot && flight.limits(plot));
      views[0].update(state);
      views[1].update(state);
      const { latitude, longitude } = values,
        known = latitude?.[0] != null && longitude?.[0] != null;
      around.fresh(latitude);
      track.update(known ? { place: [latitude[0], longitude[0]], heading: (values.heading ?? values.yaw)?.[0] } : null);
      for (const part of rest) part.update(state);
      height.tell([values.height]);
      velocity.tell([values.velocity_north, values.velocity_east, values.velocity_down]);
    },
  };
};
