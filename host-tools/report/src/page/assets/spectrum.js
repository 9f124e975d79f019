// Spectra of acceleration and body rates, of logs with the rate for it.

import { axis } from "./canvas.js";
import { line, whenColoursChange } from "./colours.js";
import { data } from "./data.js";
import { panel } from "./dom.js";
import { el } from "./elements.js";
import { section } from "./layout.js";
import { fixed } from "./text.js";

const HEIGHT = 220;
const AXES = ["x", "y", "z"];

const spectrum = ({ title, unit, rate_hz: rate, step_hz: step, strongest, values }) => {
  const words = `${unit}, from ${fixed(rate, 0)} samples a second; strongest above 10 Hz: ${strongest}`;
  const body = el("div", { class: "plotted", role: "img", "aria-label": `Spectrum of ${title}, ${words}` });
  const marks = AXES.map(() => el("i"));
  const keys = el(
    "div",
    { class: "keys" },
    AXES.map((name, i) => el("span", {}, marks[i], name)),
  );
  const box = panel(`spectrum-${title}`, title, [keys, body], { class: "plot" });
  box.node.querySelector(".name").after(el("small", {}, words));
  let made = null;
  const draw = () => {
    made?.destroy();
    marks.forEach((mark, i) => {
      mark.style.borderColor = line(i);
    });
    made = new uPlot(
      {
        width: Math.max(body.clientWidth, 200),
        height: HEIGHT,
        padding: [8, 18, 0, 0],
        cursor: { show: false },
        legend: { show: false },
        scales: { x: { time: false } },
        axes: [axis({ space: 54, size: 28, values: (_u, splits) => splits.map((hz) => `${hz} Hz`) }), axis({ size: 64, space: 28 })],
        series: [{}, ...AXES.map((_, i) => ({ stroke: line(i), width: 1.5, points: { show: false } }))],
      },
      [values[0].map((_, i) => (i + 1) * step), ...values],
      body,
    );
  };
  new ResizeObserver(() => made?.setSize({ width: Math.max(body.clientWidth, 200), height: HEIGHT })).observe(body);
  whenColoursChange(draw);
  return { node: box.node, draw };
};

export const spectrumSection = () => {
  if (!data.spectra?.length) return;
  const all = data.spectra.map(spectrum);
  section("spectrum", "Spectrum").append(
    el(
      "div",
      { class: "plots" },
      all.map(({ node }) => node),
    ),
  );
  for (const one of all) one.draw();
};
