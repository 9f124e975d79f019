// Lines over time, of the whole flight or of its last minutes.

import { say, panel } from "./dom.js";
import { el } from "./elements.js";
import { fixed, clock } from "./shown.js";
import { colour, line as lineColour, whenColoursChange } from "./colours.js";

const EVERY_MS = 100;
export const WINDOWS = [["1 min", 60], ["5 min", 300], ["whole flight", Infinity]];
let window_s = 60;
const plots = [];
export const setWindow = (seconds) => { window_s = seconds; for (const plot of plots) plot.stir(); };
export const getWindow = () => window_s;

// Room above and below; a line that hardly moves is not blown up to a storm.
const limits = (u, low, high) => {
  if (low == null || high == null || (low === 0 && high === 0)) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high), 1e-3);
  const room = Math.max((high - low) * .08, size * .01);
  return [low >= 0 && low < high - low ? 0 : low - room, high + room];
};

export const plot = (id, title, { unit, decimals = 1, name = (number) => `Motor ${number + 1}`, of = id, wanted = null }) => {
  const keys = el("div", { class: "keys" }), body = el("div", { class: "plotted" });
  const box = panel(id, title, [keys, body], { class: "plot", unit });
  let made = null, numbers = [], labels = [], drawn = -1, drawnAt = 0, begin = 0;
  const axis = (extra) => ({
    stroke: colour("dim"), font: "11px system-ui, 'DejaVu Sans', sans-serif",
    grid: { stroke: colour("grid"), width: 1 }, ticks: { show: false }, ...extra,
  });
  const build = () => {
    made?.destroy();
    labels = numbers.map((number) => {
      const mark = el("i"), value = el("b", { "data-value": `${id}:${number}` });
      mark.style.background = lineColour(number);
      return { node: el("span", {}, mark, name(number), value), value };
    });
    keys.replaceChildren(...labels.map((label) => label.node));
    made = new uPlot({
      width: Math.max(body.clientWidth, 200), height: 168, padding: [8, 6, 0, 0],
      cursor: { show: false }, legend: { show: false },
      scales: { x: { time: false }, y: { range: limits } },
      axes: [
        axis({ values: (u, splits) => splits.map((s) => clock(s - begin)), space: 60, size: 24,
          incrs: [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000] }),
        axis({ size: 46, space: 28 }),
      ],
      series: [{}, ...numbers.map((number) => ({ stroke: lineColour(number), width: 1.6, points: { show: false } }))],
    }, [[], ...numbers.map(() => [])], body);
  };
  const self = {
    node: box.node,
    stir() { drawn = -1; drawnAt = 0; },
    update(history, now, start, shown) {
      box.fresh(...shown.filter(Boolean));
      const known = history.numbers(of).filter((number) => !wanted || wanted.includes(number));
      if (made == null || known.join() !== numbers.join()) { numbers = known; build(); self.stir(); }
      shown.forEach((value, number) => { const label = labels[numbers.indexOf(number)]; if (label) say(label.value, fixed(value?.[0], decimals)); });
      const time = performance.now();
      if (time - drawnAt < EVERY_MS || history.version === drawn) return;
      drawn = history.version;
      drawnAt = time;
      begin = start;
      const from = Math.max(start, now - window_s), to = Math.max(now, from + Math.min(window_s, 10));
      made.setData(history.table(of, numbers, from), false);
      made.batch(() => {
        made.setScale("x", { min: from, max: to });
      });
    },
  };
  new ResizeObserver(() => made?.setSize({ width: Math.max(body.clientWidth, 200), height: 168 })).observe(body);
  whenColoursChange(() => { if (made) { build(); self.stir(); } });
  plots.push(self);
  return self;
};
