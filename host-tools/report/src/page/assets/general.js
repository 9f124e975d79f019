// Voltage, flight time, air.

import { el } from "./elements.js";
import { flight } from "./flight.js";
import { gauge } from "./gauge.js";
import { stat } from "./spark.js";
import { clock } from "./text.js";

export const general = () => {
  const time = stat("flight_time", "Flight time", { format: clock });
  const volts = stat("battery_volts", "Battery voltage", { unit: "V", line: "PackVolts" });
  const pressure = gauge("pressure", "Air pressure", { unit: "hPa", low: 500, high: 1100 });
  const celsius = stat("temperature", "Baro temperature", {
    unit: "\u00b0C",
    decimals: 1,
    line: "Temperature",
    numbers: [0, 3],
  });
  return {
    node: el(
      "section",
      { class: "row", id: "general" },
      el("h2", {}, "Battery and air"),
      el(
        "div",
        { class: "instruments" },
        [volts, time, pressure, celsius].map((part) => part.node),
      ),
    ),
    update({ values, cells, now_s: now }) {
      time.update(values.flight_time, now);
      const [warning, critical] = flight.limits("CellVolts") ?? [0, 0],
        lowest = Math.min(...cells);
      // A pack that reports no cells has none to be judged by.
      const level = cells.length < 2 ? "" : lowest < critical ? "critical" : lowest < warning ? "warning" : "";
      volts.update(values.battery_volts, now, level);
      pressure.update(values.pressure);
      celsius.update(values.temperature, now);
    },
  };
};
