// What a health monitor shows besides: vibration, estimator, GNSS, radio, and an engine where there is one.

import { say, panel, toggle } from "./dom.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { fixed } from "./text.js";
import { bars } from "./bar.js";

const FIXES = ["none", "none", "2D", "3D", "3D, DGPS", "RTK float", "RTK fixed", "static", "PPP"];

const facts = (id, title, rows, key) => {
  const numbers = rows.map(([name]) => el("b", { "data-value": name }));
  const fact = ([, label, unit], i) => el("div", { class: "fact" }, el("dt", {}, label), el("dd", {}, numbers[i], unit ? ` ${unit}` : ""));
  const lines = rows.map(fact);
  const box = panel(id, title, el("dl", { class: "facts" }, lines));
  return {
    node: box.node,
    update(values) {
      box.fresh(
        ...[]
          .concat(key)
          .map((name) => values[name])
          .filter(Boolean)
          .slice(0, 1),
      );
      rows.forEach(([name, , , decimals, format], i) => {
        const shown = values[name];
        say(numbers[i], shown && format ? format(shown[0]) : fixed(shown?.[0], decimals));
        toggle(lines[i], "stale", Boolean(shown?.[2]));
      });
    },
  };
};

export const condition = () => {
  const axis = (id, title) => ({ id, title, size: 90, decimals: 1 });
  const shaking = bars([axis("vibration_0", "Forward"), axis("vibration_1", "Right"), axis("vibration_2", "Down")]);
  const metrics = bars([0, 1, 2].map((i) => ({ id: `vibration_px4_${i}`, title: ["Coning", "Gyro", "Accel."][i], size: 15, decimals: 2 })));
  const clips = el("b", { "data-value": "clips" });
  const clipped = el("p", { class: "pair" }, el("span", {}, "clipped samples ", clips));
  const vibration = panel("vibration", "Vibration", [shaking.node, metrics.node, clipped]);
  const figure = (id, title) => ({ id, title, size: 1.5, decimals: 2 });
  const figures = bars([
    figure("ekf_velocity", "Velocity"),
    figure("ekf_horizontal", "Horizontal"),
    figure("ekf_vertical", "Vertical"),
    figure("ekf_compass", "Compass"),
  ]);
  const estimator = panel("estimator", "EKF (estimator)", figures.node);
  const gnss = facts(
    "gnss",
    "GPS",
    [
      ["fix", "Fix", "", 0, (fix) => FIXES[fix] ?? String(fix)],
      ["satellites", "Satellites", "", 0],
      ["hdop", "HDOP", "", 2],
      ["accuracy", "Accuracy", "m", 2],
      ["gnss_speed", "Speed", "m/s", 2],
    ],
    "fix",
  );
  const wind = facts(
    "wind",
    "Wind, by the autopilot",
    [
      ["wind", "Speed", "m/s", 1],
      ["wind_from", "From", "\u00b0", 0],
    ],
    "wind",
  );
  const battery = facts(
    "battery",
    "Battery and computer",
    [
      ["battery_amperes", "Current", "A", 2],
      ["battery_consumed", "Charge taken", "Ah", 3],
      ["battery_celsius", "Battery temperature", "\u00b0C", 1],
      ["rail_5v", "5 V supply", "V", 2],
      ["load", "Processor load", "%", 0],
    ],
    ["battery_amperes", "load"],
  );
  const radio = facts(
    "radio",
    "Radio",
    [
      ["rc_rssi", "RC signal", "", 0],
      ["radio_rssi", "Radio here", "", 0],
      ["radio_remote_rssi", "Radio there", "", 0],
      ["radio_noise", "Noise here", "", 0],
    ],
    ["radio_rssi", "rc_rssi"],
  );
  const engine = facts(
    "engine-now",
    "Engine and speed sensors",
    [
      ["engine_rpm", "Speed", "rpm", 0],
      ["engine_load", "Load", "%", 0],
      ["engine_fuel_flow", "Fuel flow", "cm\u00b3/min", 2],
      ["engine_fuel_consumed", "Fuel consumed", "cm\u00b3", 1],
      ["engine_head_celsius", "Cylinder head", "\u00b0C", 0],
      ["speed_sensor_0", "Sensor 1", "rpm", 0],
      ["speed_sensor_1", "Sensor 2", "rpm", 0],
    ],
    ["engine_rpm", "speed_sensor_0"],
  );
  const parts = [vibration.node, estimator.node, gnss.node, wind.node, battery.node, radio.node, engine.node];
  return {
    node: el("section", { class: "row", id: "condition" }, el("h2", {}, "Condition"), el("div", { class: "conditions" }, parts)),
    update({ values, px4, now_s: now }) {
      const shown = [values.vibration_0, values.vibration_1, values.vibration_2];
      vibration.fresh(shown[0]);
      shaking.node.hidden = px4;
      metrics.node.hidden = !px4;
      // PX4's limits are for its third metric.
      (px4 ? metrics : shaking).update(shown, flight.limits("Vibration"));
      say(clips, fixed(values.clips?.[0], 0));
      estimator.fresh(values.ekf_velocity);
      figures.update([values.ekf_velocity, values.ekf_horizontal, values.ekf_vertical, values.ekf_compass], flight.limits("Estimator"));
      for (const part of [gnss, battery, radio, engine]) part.update(values);
      const blown = (plot) => [flight.value(plot, 0, now)].filter((value) => value != null).map((value) => [value, 0, 0])[0];
      wind.node.hidden = flight.value("Wind", 0) == null;
      wind.update({ wind: blown("Wind"), wind_from: blown("WindFrom") });
      engine.node.hidden = !values.engine_rpm && !values.speed_sensor_0;
      radio.node.hidden = !values.rc_rssi && !values.radio_rssi;
    },
  };
};
