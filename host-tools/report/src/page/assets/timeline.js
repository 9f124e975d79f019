// Phases, modes, findings and gaps of the whole flight on one strip, and what of it is looked at.

import { canvas } from "./canvas.js";
import { PHASES, colour, modeColour, whenColoursChange } from "./colours.js";
import { attribute } from "./dom.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { clock, words } from "./text.js";
import { home, lookAt, moveCursor, view, whenCursorMoves, whenViewChanges } from "./view.js";

const EVERY_MS = 250,
  HEIGHT = 96,
  ROW = 20,
  PHASE_TOP = 24,
  MODE_TOP = 47,
  AXIS_TOP = 70;
const STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 36000, 86400, 604800];

export const timeline = (go = lookAt) => {
  const strip = el("canvas", {
    class: "strip",
    id: "timeline",
    role: "slider",
    tabindex: 0,
    "aria-label": "Time: phases, modes, findings and gaps; arrows move the cursor, Enter looks closer",
  });
  const legend = el("div", { class: "legend" });
  const node = el("div", { class: "panel" }, strip, legend);
  let drawn = "",
    drawnAt = 0;
  const width = () => strip.clientWidth || 600;
  const x = (at) => ((at - flight.start) / Math.max(flight.end - flight.start, 1e-3)) * width();
  const row = (ctx, spans, top, paint, text) =>
    spans.forEach(([from, name], i) => {
      const left = Math.max(x(from), 0),
        wide = x(spans[i + 1]?.[0] ?? flight.end) - left;
      ctx.fillStyle = paint(name);
      ctx.fillRect(left, top, Math.max(wide, 1), ROW);
      const size = ctx.measureText(text(name)).width;
      if (wide < size + 10) return;
      ctx.fillStyle = "#fff";
      ctx.fillText(text(name), left + (wide - size) / 2, top + 14.5);
    });
  const paint = () => {
    const here = view.cursor ?? view.from;
    attribute(strip, "aria-valuemin", String(Math.round(flight.start)));
    attribute(strip, "aria-valuemax", String(Math.round(flight.end)));
    attribute(strip, "aria-valuenow", String(Math.round(here)));
    attribute(strip, "aria-valuetext", clock(here - flight.zero));
    const ctx = canvas(strip, width(), HEIGHT);
    ctx.fillStyle = colour("soft");
    ctx.fillRect(0, PHASE_TOP, width(), MODE_TOP + ROW - PHASE_TOP);
    row(ctx, flight.phases, PHASE_TOP, (name) => PHASES[name] ?? PHASES.ground, words);
    row(ctx, flight.modes, MODE_TOP, modeColour, (name) => name);
    for (const [from, to] of flight.gaps) {
      const left = x(from),
        wide = Math.max(x(to) - left, 2);
      ctx.fillStyle = colour("panel");
      ctx.fillRect(left, PHASE_TOP, wide, MODE_TOP + ROW - PHASE_TOP);
      ctx.strokeStyle = colour("critical");
      ctx.strokeRect(left + 0.5, PHASE_TOP + 0.5, wide - 1, MODE_TOP + ROW - PHASE_TOP - 1);
    }
    for (const { kind, level, at_s } of flight.notes) {
      if (kind !== "finding" || level === "ok") continue;
      ctx.fillStyle = colour(level);
      ctx.beginPath();
      ctx.moveTo(x(at_s), PHASE_TOP - 1);
      ctx.lineTo(x(at_s) - 5, 10);
      ctx.lineTo(x(at_s) + 5, 10);
      ctx.fill();
    }
    const step = STEPS.find((s) => (flight.end - flight.start) / s <= width() / 90) ?? STEPS[STEPS.length - 1];
    ctx.fillStyle = colour("dim");
    for (let at = flight.zero + Math.ceil((flight.start - flight.zero) / step) * step; at <= flight.end; at += step) {
      const text = clock(Math.round(at - flight.zero)),
        wide = ctx.measureText(text).width;
      ctx.fillRect(x(at), AXIS_TOP, 1, 4);
      ctx.fillText(text, Math.min(Math.max(x(at) - wide / 2, 0), width() - wide), AXIS_TOP + 18);
    }
    ctx.strokeStyle = colour("ink");
    ctx.lineWidth = 2;
    if (view.away)
      ctx.strokeRect(x(view.from) + 1, PHASE_TOP - 2, Math.max(x(view.to) - x(view.from) - 2, 2), MODE_TOP + ROW - PHASE_TOP + 4);
    ctx.fillStyle = colour("ink");
    if (view.cursor != null) ctx.fillRect(x(view.cursor) - 0.75, 4, 1.5, AXIS_TOP);
    const phases = [...new Set(flight.phases.map(([, phase]) => phase))],
      key = phases.join();
    if (legend.dataset.key === key) return;
    legend.dataset.key = key;
    legend.replaceChildren(
      ...phases.map((phase) => {
        const mark = el("i");
        mark.style.background = PHASES[phase];
        return el("span", {}, mark, words(phase));
      }),
      el("span", {}, "below: flight mode"),
      flight.gaps.length ? el("span", {}, "framed in red: a gap in the record") : "",
      el("span", { class: "noprint" }, "Drag over a plot to look closer, double click for all."),
    );
  };
  const self = {
    node,
    update(now = false) {
      const key = `${flight.version} ${view.from} ${view.to} ${view.away} ${view.cursor} ${flight.end} ${width()}`,
        at = performance.now();
      if (!now && (key === drawn || at - drawnAt < EVERY_MS)) return;
      [drawn, drawnAt] = [key, at];
      paint();
    },
  };
  // Everything that the mouse does: a step is a hundredth of what is looked at.
  strip.addEventListener("keydown", (event) => {
    const size = (view.to - view.from) / (event.shiftKey ? 10 : 100),
      at = view.cursor ?? (view.from + view.to) / 2,
      does = {
        ArrowLeft: () => moveCursor(Math.max(at - size, flight.start)),
        ArrowRight: () => moveCursor(Math.min(at + size, flight.end)),
        Home: () => moveCursor(flight.start),
        End: () => moveCursor(flight.end),
        Enter: () => go(at),
        Escape: home,
      }[event.key];
    if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    does();
  });
  strip.addEventListener("blur", () => moveCursor(null));
  strip.addEventListener("click", (event) => {
    const box = strip.getBoundingClientRect();
    go(flight.start + ((event.clientX - box.left) / box.width) * (flight.end - flight.start));
  });
  whenViewChanges(() => self.update(true));
  whenCursorMoves(() => self.update(true));
  whenColoursChange(() => self.update(true));
  new ResizeObserver(() => self.update(true)).observe(strip);
  return self;
};
