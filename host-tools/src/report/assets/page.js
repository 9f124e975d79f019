// The page from top to bottom, and when it is drawn anew.

import { chart, charts } from "./charts.js";
import { data, grid } from "./data.js";
import { el } from "./elements.js";
import { findingsSection } from "./findings.js";
import { head } from "./head.js";
import { bar, main, section } from "./layout.js";
import { drawMap, paintMap, places, trackMap } from "./map.js";
import { messagesSection } from "./messages.js";
import { recorderSection } from "./recorder.js";
import { summary } from "./summary.js";
import { drawStrip, timeline } from "./timeline.js";
import { trendSection } from "./trend.js";
import { usageSection } from "./usage.js";
import { back } from "./view.js";

const root = document.documentElement;

head();
summary();
findingsSection();
const time = section("time", "Timeline and track");
timeline(time);
trackMap(time);

// The plots by group; the first of each is as wide as the page, pairs follow.
const groups = [...new Set(data.plots.map((p) => p.group))];
for (const title of groups) {
  const host = section(title.toLowerCase(), title);
  const of = data.plots.filter((p) => p.group === title);
  const box = el("div", { class: of.length > 1 ? "plots two" : "plots" });
  host.append(box);
  // Drawn when all are there: how wide each is depends on how many there are.
  for (const made of of.map((plot) => chart(plot, box))) made.draw();
}

usageSection();
trendSection();
recorderSection();
messagesSection();

document.getElementById("foot").append(`Made by hums ${data.version}. Times count from the session's start; intervals of ${grid.interval_s >= 1 ? grid.interval_s + " s" : grid.interval_s * 1000 + " ms"} keep their lowest and highest value. Plots: uPlot, MIT.`);
bar.append(back);

// ---- Redrawing.
const redraw = () => { for (const chart of charts) chart.draw(); drawStrip(); if (places) paintMap(); };
const fit = () => { for (const chart of charts) chart.resize(); drawStrip(); drawMap(); };
drawStrip();
drawMap();
let width = main.clientWidth;
new ResizeObserver(() => {
  if (main.clientWidth === width) return;
  width = main.clientWidth;
  fit();
}).observe(main);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
addEventListener("beforeprint", () => { root.classList.add("printing"); redraw(); fit(); });
addEventListener("afterprint", () => { root.classList.remove("printing"); redraw(); });
root.dataset.ready = "true";
