// The reference system's third row: Movement Information; with horizon, heading and track.

import { say, panel } from "./dom.js";
import { el } from "./elements.js";
import { fixed } from "./shown.js";
import { bars } from "./bar.js";
import { compass } from "./compass.js";
import { gauge } from "./gauge.js";
import { horizon } from "./horizon.js";
import { map } from "./map.js";
import { plot } from "./plot.js";

const place = () => {
  const numbers = ["latitude", "longitude"].map((id) => el("b", { "data-value": id }));
  const height = el("b", { "data-value": "height" }), altitude = el("b", { "data-value": "altitude" });
  const box = panel("place", "Position", el("dl", { class: "place" },
    [["Latitude", numbers[0], "\u00b0"], ["Longitude", numbers[1], "\u00b0"], ["Above sea level", altitude, " m"], ["Above home", height, " m"]]
      .map(([name, number, unit]) => el("div", {}, el("dt", {}, name), el("dd", {}, number, unit)))), { class: "instrument" });
  return {
    node: box.node,
    update({ values }) {
      box.fresh(values.latitude, values.longitude);
      say(numbers[0], fixed(values.latitude?.[0], 7));
      say(numbers[1], fixed(values.longitude?.[0], 7));
      say(altitude, fixed(values.altitude?.[0], 1));
      say(height, fixed(values.height?.[0], 1));
    },
  };
};

const acceleration = () => {
  const part = (id, title) => ({ id, title, size: 20, both: true, unit: "m/s\u00b2" });
  const three = bars([part("accel_front", "Front"), part("accel_right", "Right"), part("accel_down", "Down")]);
  const module = el("b", { "data-value": "accel_module" });
  const box = panel("acceleration", "Acceleration", [three.node, el("p", { class: "pair" }, el("span", {}, "Module ", module, " m/s\u00b2"))], { class: "instrument" });
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
  const speeds = [
    ["airspeed", gauge("airspeed", "Air speed", { unit: "m/s", high: 20, decimals: 1, grows: true })],
    ["groundspeed", gauge("groundspeed", "Ground speed", { unit: "m/s", high: 20, decimals: 1, grows: true })],
    ["velocity_module", gauge("velocity_module", "Velocity module", { unit: "m/s", high: 20, decimals: 1, grows: true })],
    ["climb", gauge("climb", "Climb rate", { unit: "m/s", low: -10, high: 10, decimals: 1 })],
    ["throttle", gauge("throttle", "Throttle", { unit: "%", high: 100 })],
  ];
  const views = [horizon(), compass(), map()], rest = [place(), acceleration()];
  const altitude = plot("altitude", "Altitude", { unit: "m", name: () => "above sea level" });
  const velocity = plot("velocity", "NED velocity", { unit: "m/s", decimals: 2, name: (axis) => ["North", "East", "Down"][axis] });
  return {
    node: el("section", { class: "row", id: "movement" }, el("h2", {}, "Movement"),
      el("div", { class: "views" }, views[0].node, views[2].node),
      el("div", { class: "instruments" }, views[1].node, speeds.map(([, part]) => part.node)),
      el("div", { class: "pairs" }, rest.map((part) => part.node)),
      el("div", { class: "plots" }, altitude.node, velocity.node)),
    update(state, history, start) {
      const { values } = state;
      for (const [name, part] of speeds) part.update(values[name]);
      views[0].update(state);
      views[1].update(state);
      views[2].update(state, history);
      for (const part of rest) part.update(state);
      altitude.update(history, state.now_s, start, [values.altitude]);
      velocity.update(history, state.now_s, start, [values.velocity_north, values.velocity_east, values.velocity_down]);
    },
  };
};
