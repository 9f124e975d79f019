// Phases, findings and gaps on one strip, and the way there and back.

import { canvas } from "./canvas.js";
import { data, findings, gaps, start } from "./data.js";
import { el } from "./elements.js";
import { PHASES, css, fixed, phaseName, span } from "./format.js";
import { point } from "./charts.js";
import { view, whenViewChanges } from "./view.js";

const strip = el("canvas", { class: "map", id: "timeline", role: "img", "aria-label": "Phases, findings and gaps over time" });
const stripX = (at, width) => (at - view.from) / (view.to - view.from) * width;
export const drawStrip = () => {
  const [ctx, width] = canvas(strip, 74);
  const x = (at) => stripX(at, width);
  ctx.fillStyle = css("--soft");
  ctx.fillRect(0, 26, width, 22);
  for (const phase of data.phases) {
    const left = x(phase.from_s), wide = x(phase.to_s) - left;
    ctx.fillStyle = PHASES[phase.phase];
    ctx.fillRect(left, 26, Math.max(wide, 1), 22);
    const label = ctx.measureText(phaseName(phase.phase)).width;
    if (wide > label + 10) {
      ctx.fillStyle = "#fff";
      ctx.fillText(phaseName(phase.phase), left + (wide - label) / 2, 41);
    }
  }
  ctx.fillStyle = css("--ink");
  for (const [from, to] of gaps) {
    const left = x(from), wide = Math.max(x(to) - left, 2);
    ctx.fillStyle = css("--paper");
    ctx.fillRect(left, 26, wide, 22);
    ctx.strokeStyle = css("--critical");
    ctx.strokeRect(left + .5, 26.5, wide - 1, 21);
  }
  for (const f of findings) {
    const at = x(f.time_s);
    ctx.fillStyle = css("--" + f.level);
    ctx.beginPath();
    ctx.moveTo(at, 25);
    ctx.lineTo(at - 5, 12);
    ctx.lineTo(at + 5, 12);
    ctx.fill();
  }
  ctx.fillStyle = css("--dim");
  const steps = [.1, .2, .5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 36000, 86400];
  const step = steps.find((s) => (view.to - view.from) / s <= width / 90) ?? 604800;
  for (let at = start + Math.ceil((view.from - start) / step) * step; at <= view.to; at += step) {
    const text = step < 1 ? fixed(at - start, 1) : span(at - start);
    const wide = ctx.measureText(text).width;
    ctx.fillRect(x(at), 48, 1, 4);
    ctx.fillText(text, Math.min(Math.max(x(at) - wide / 2, 0), width - wide), 65);
  }
};
strip.addEventListener("click", (event) => {
  const rect = strip.getBoundingClientRect();
  point(view.from + (event.clientX - rect.left) / rect.width * (view.to - view.from));
});
const shownPhases = [...new Set(data.phases.map((p) => p.phase))];
const dot = (colour) => { const i = el("i"); i.style.background = colour; return i; };
whenViewChanges(drawStrip);

export const timeline = (host) => {
  host.append(el("div", { class: "panel strip" }, strip, el("div", { class: "legend" },
    shownPhases.map((phase) => el("span", {}, dot(PHASES[phase]), phaseName(phase))),
    gaps.length ? el("span", {}, "framed in red: a gap in the record") : null,
    el("span", { class: "noprint" }, "Drag over a plot to look closer; double click for the whole session."))));
};
