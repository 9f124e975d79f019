// A number with its course below: a stat with a sparkline.

import { say, panel, toggle } from "./dom.js";
import { colour } from "./colours.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { fixed } from "./text.js";

// Pixels of the picture, twice as fine as it is shown.
const WIDTH = 320,
  HEIGHT = 72;
const EVERY_MS = 250;

export const stat = (id, title, { unit = "", decimals = 2, line = null, numbers = [0], format = fixed, window = 300 }) => {
  const number = el("b", { "data-value": id });
  const canvas = el("canvas", { width: WIDTH, height: HEIGHT, "aria-hidden": "true" });
  const box = panel(id, title, [el("p", { class: "stat" }, number, unit ? el("small", {}, unit) : null), line ? canvas : ""], {
    class: "instrument",
  });
  let drawn = "",
    drawnAt = 0;
  const draw = (now) => {
    const ctx = canvas.getContext("2d");
    ctx.clearRect(0, 0, WIDTH, HEIGHT);
    // Of several sources the first one that tells anything.
    const number = numbers.find((one) => flight.value(line, one) != null) ?? 0,
      [times, column] = flight.table(line, [number], now - window, now);
    const points = [];
    times.forEach((time, i) => {
      if (column[i] != null) points.push([time, column[i]]);
    });
    if (points.length < 2) return;
    const first = Math.max(points[0][0], now - window),
      span = Math.max(now - first, 1);
    const values = points.map(([, v]) => v),
      low = Math.min(...values),
      high = Math.max(...values);
    const room = Math.max((high - low) * 0.12, Math.abs(high) * 0.004, 1e-6);
    const x = (t) => ((t - first) / span) * (WIDTH - 6) + 2;
    const y = (v) => HEIGHT - 3 - ((v - low + room) / (high - low + 2 * room)) * (HEIGHT - 6);
    ctx.beginPath();
    for (const [t, v] of points) ctx.lineTo(x(t), y(v));
    ctx.strokeStyle = colour("accent");
    ctx.lineWidth = 3;
    ctx.lineJoin = "round";
    ctx.stroke();
    ctx.lineTo(x(points[points.length - 1][0]), HEIGHT);
    ctx.lineTo(x(points[0][0]), HEIGHT);
    ctx.fillStyle = colour("accent-soft");
    ctx.fill();
  };
  return {
    node: box.node,
    update(shown, now, level = "") {
      box.fresh(shown);
      say(number, format(shown?.[0], decimals));
      for (const name of ["warning", "critical"]) toggle(box.node, `is-${name}`, level === name);
      const time = performance.now(),
        key = `${flight.version} ${now}`;
      if (line && key !== drawn && time - drawnAt >= EVERY_MS) {
        drawn = key;
        drawnAt = time;
        draw(now);
      }
    },
  };
};
