// The reference system's second row: ESC Information, for as many motors as there are.

import { shape, shapeIs } from "./badge.js";
import { say, panel, toggle } from "./dom.js";
import { el } from "./elements.js";
import { whole, fixed } from "./text.js";
import { gauge } from "./gauge.js";
import { chart } from "./plot.js";

// ESC_FAILURE_FLAGS, from the lowest bit up.
const FAILURES = ["over current", "over voltage", "over temperature", "over speed", "inconsistent command", "stuck", "generic"];
const failing = (flags) => FAILURES.filter((_, bit) => (flags >> bit) & 1).join(", ") || `flags ${flags}`;

const fails = () => {
  const body = el("tbody");
  const box = panel(
    "esc_fails",
    "ESC fails",
    el(
      "table",
      {},
      el(
        "thead",
        {},
        el(
          "tr",
          {},
          ["Motor", "Count", "Now", "\u00b0C"].map((name, i) => el("th", { scope: "col", class: i === 1 || i === 3 ? "n" : "" }, name)),
        ),
      ),
      body,
    ),
  );
  let rows = [];
  return {
    node: box.node,
    update(motors) {
      box.fresh(...motors.map((motor) => motor.errors ?? motor.failures ?? motor.rpm));
      while (rows.length < motors.length) {
        const i = rows.length,
          mark = shape();
        const cell = (name) => el("td", { class: "n", "data-value": `${name}:${i}` });
        const row = {
          mark,
          count: cell("esc_errors"),
          now: el("span", { "data-value": `esc_failures:${i}` }),
          celsius: cell("esc_celsius"),
        };
        body.append(
          el("tr", {}, el("th", { scope: "row" }, String(i + 1)), row.count, el("td", { class: "state" }, mark, row.now), row.celsius),
        );
        rows.push(row);
      }
      motors.forEach((motor, i) => {
        const flags = motor.failures?.[0];
        say(rows[i].count, whole(motor.errors?.[0]));
        say(rows[i].now, flags == null ? "not told" : flags === 0 ? "none" : failing(flags));
        shapeIs(rows[i].mark, flags == null ? "stale" : flags === 0 ? "ok" : "critical");
        say(rows[i].celsius, fixed(motor.celsius?.[0], 0));
      });
    },
    clear() {
      rows = [];
      body.replaceChildren();
    },
  };
};

export const esc = () => {
  const gauges = el("div", { class: "instruments motors" });
  const currents = chart("MotorAmperes", "ESC currents"),
    voltages = chart("MotorVolts", "ESC voltages");
  const table = fails();
  const none = el("p", { class: "dim empty" }, "No ESC tells anything on this link.");
  const node = el(
    "section",
    { class: "row", id: "esc" },
    el("h2", {}, "ESC"),
    none,
    gauges,
    el("div", { class: "plots three" }, currents.node, voltages.node, table.node),
  );
  let motors = [],
    scale = null;
  return {
    node,
    update(state) {
      const told = state.motors;
      toggle(node, "silent", told.length === 0);
      if (told.length < motors.length) {
        motors = [];
        gauges.replaceChildren();
        table.clear();
      }
      if (!motors.length) scale = { top: 8000, grows: true };
      while (motors.length < told.length) {
        const i = motors.length;
        const motor = gauge(`esc_rpm:${i}`, `Motor ${i + 1}`, { unit: "rpm", scale, class: "small" });
        motors.push(motor);
        gauges.append(motor.node);
      }
      if (!told.length) return;
      for (const [i, motor] of motors.entries()) motor.update(told[i].rpm);
      currents.tell(told.map((motor) => motor.amperes));
      voltages.tell(told.map((motor) => motor.volts));
      table.update(told);
    },
  };
};
