// The reference system's first row: General Information.

import { el } from "./elements.js";
import { clock } from "./shown.js";
import { gauge } from "./gauge.js";
import { stat } from "./spark.js";

export const general = () => {
  const time = stat("flight_time", "Flight time", { line: "flight_time", format: clock, window: 600 });
  const percent = gauge("battery_percent", "Battery", { unit: "%", high: 100 });
  const volts = stat("battery_volts", "Battery voltage", { unit: "V", line: "battery_volts" });
  const pressure = gauge("pressure", "Air pressure", { unit: "hPa", low: 500, high: 1100 });
  const celsius = stat("temperature", "Temperature", { unit: "\u00b0C", decimals: 1, line: "temperature" });
  return {
    node: el("section", { class: "row", id: "general" }, el("h2", {}, "General"),
      el("div", { class: "instruments" }, [time, percent, volts, pressure, celsius].map((part) => part.node))),
    update(state, history) {
      const { values, limits, cells, now_s: now } = state;
      time.update(values.flight_time, history, now);
      percent.update(values.battery_percent, limits.battery_percent);
      const [warning, critical] = limits.cell_volts, lowest = Math.min(...cells);
      // A pack that reports no cells has none to be judged by.
      const level = cells.length < 2 ? "" : lowest < critical ? "critical" : lowest < warning ? "warning" : "";
      volts.update(values.battery_volts, history, now, level);
      pressure.update(values.pressure);
      celsius.update(values.temperature, history, now);
    },
  };
};
