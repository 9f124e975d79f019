// The plots: phases, gaps and findings behind the lines, one cursor for all.

import { data, end, findings, gaps, start } from "./data.js";
import { el } from "./elements.js";
import { PHASES, css, dark, fixed, line, span } from "./format.js";
import { table } from "./series.js";
import { grouped } from "./text.js";
import { look, moveCursor, view, whenViewChanges } from "./view.js";

export const charts = [];
whenViewChanges(() => { for (const chart of charts) chart.plot.setScale("x", { min: view.from, max: view.to }); });

const axis = (extra) => ({
  stroke: css("--dim"), font: "12px system-ui, 'DejaVu Sans', sans-serif",
  grid: { stroke: css("--grid"), width: 1 }, ticks: { stroke: css("--grid"), width: 1, size: 4 }, ...extra,
});
const times = (u, splits) => {
  const fine = splits.length > 1 && splits[1] - splits[0] < 1;
  return splits.map((s) => fine ? fixed(s - start, 1) : span(s - start));
};
const marks = (u) => {
  const { ctx, bbox } = u;
  const x = (at) => u.valToPos(at, "x", true);
  const left = bbox.left, right = bbox.left + bbox.width;
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const phase of data.phases) {
    if (phase.phase === "ground") continue;
    ctx.fillStyle = PHASES[phase.phase] + (dark() ? "1c" : "14");
    ctx.fillRect(x(phase.from_s), bbox.top, x(phase.to_s) - x(phase.from_s), bbox.height);
  }
  ctx.fillStyle = css("--gap");
  for (const [from, to] of gaps) ctx.fillRect(x(from), bbox.top, Math.max(x(to) - x(from), 2), bbox.height);
  for (const f of findings) {
    const at = x(f.time_s);
    if (at < left || at > right || f.level === "ok") continue;
    ctx.strokeStyle = css("--" + f.level);
    ctx.globalAlpha = .75;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.restore();
};
const sync = uPlot.sync("time");
export const chart = (plot, host) => {
  const columns = table(plot);
  const keys = plot.series.map((series, i) => {
    const key = el("button", { type: "button", title: "show or hide" }, el("i"), series.label, el("b"));
    key.addEventListener("click", () => {
      const shown = !made.plot.series[i + 1].show;
      key.classList.toggle("off", !shown);
      made.plot.setSeries(i + 1, { show: shown });
    });
    return key;
  });
  const body = el("div");
  const box = el("div", { class: "panel plot", id: "plot-" + plot.id },
    el("h3", {}, plot.title, plot.unit ? el("small", { class: "dim" }, plot.unit) : null),
    el("div", { class: "keys" }, keys), body);
  host.append(box);
  const made = { plot: null, info: plot };
  const show = (u) => {
    const i = u.cursor.idx;
    plot.series.forEach((series, s) => {
      let at = i;
      // The nearest value before, where this series is slower than others of its plot.
      while (at != null && at > 0 && u.data[s + 1][at] == null && i - at < 400) at--;
      const v = at == null ? null : u.data[s + 1][at];
      keys[s].lastChild.textContent = v == null ? "" : fixed(v, plot.decimals);
    });
    moveCursor(i == null ? null : u.data[0][i]);
  };
  made.draw = () => {
    made.plot?.destroy();
    body.replaceChildren();
    plot.series.forEach((series, s) => { keys[s].firstChild.style.borderColor = line(series.line); });
    made.plot = new uPlot({
      width: Math.max(body.clientWidth, 240), height: innerWidth < 760 ? 170 : 190, padding: [8, 8, 0, 0],
      cursor: { sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false, setScale: false }, points: { size: 6 } },
      legend: { show: false },
      scales: { x: { time: false, min: view.from, max: view.to, range: (u, min, max) => [min ?? view.from, max ?? view.to] }, y: { range: limits } },
      axes: [
        axis({ values: times, space: 70, size: 28, incrs: [.1, .2, .5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000, 86400, 604800] }),
        axis({ size: 58, values: (u, splits) => splits.map((v) => grouped(String(Number(v.toPrecision(6))))) }),
      ],
      series: [{}, ...plot.series.map((series, s) => ({
        label: series.label, stroke: line(series.line), width: 1.4, points: { show: false }, spanGaps: false,
        show: !keys[s].classList.contains("off"),
        paths: plot.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
      }))],
      hooks: {
        drawClear: [marks],
        setCursor: [show],
        setSelect: [(u) => {
          if (u.select.width < 4) return;
          const from = u.posToVal(u.select.left, "x"), to = u.posToVal(u.select.left + u.select.width, "x");
          u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          look(from, to);
        }],
        ready: [(u) => u.over.addEventListener("dblclick", () => look(start, end))],
      },
    }, columns, body);
  };
  made.resize = () => made.plot?.setSize({ width: Math.max(body.clientWidth, 240), height: made.plot.height });
  charts.push(made);
  return made;
};
// Room above and below; a line that hardly moves is not blown up to a storm.
const limits = (u, low, high) => {
  if (low == null || high == null) return [0, 1];
  if (low === 0 && high === 0) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high), 1e-3);
  const room = Math.max((high - low) * 0.08, size * 0.01);
  return [low >= 0 && low < (high - low) ? 0 : low - room, high + room];
};
export const point = (at) => {
  for (const { plot } of charts) {
    const left = plot.valToPos(at, "x");
    plot.setCursor({ left, top: plot.cursor.top < 0 ? 20 : plot.cursor.top }, false);
  }
  moveCursor(at);
};
