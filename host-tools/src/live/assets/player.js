// A recording's time: play and pause, where it is, how fast; findings stand on the line.

import { say, attribute } from "./dom.js";
import { el, svg } from "./elements.js";
import { clock } from "./shown.js";
import { colour, whenColoursChange } from "./colours.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16, 32];

export const player = (send) => {
  const icon = svg("path"), button = el("button", { type: "button", class: "play", onclick: () => self.toggle() }, svg("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, icon));
  const at = el("output", { class: "at", "data-value": "now" }), end = el("span", { class: "dim" });
  const slider = el("input", { type: "range", min: 0, max: 1, step: 0.05, value: 0, "aria-label": "Time in the recording" });
  const canvas = el("canvas", { "aria-hidden": "true" });
  const speed = el("select", { "aria-label": "Speed" }, SPEEDS.map((value) => el("option", { value }, `${value}\u00d7`)));
  const bar = el("div", { class: "bar-of-time", hidden: true }, button, at, el("div", { class: "line" }, canvas, slider), end, speed);
  let source = null, now = 0, dragging = false, marks = [];
  slider.addEventListener("input", () => { dragging = true; self.seek(Number(slider.value)); });
  slider.addEventListener("change", () => { dragging = false; });
  speed.addEventListener("change", () => send({ cmd: "speed", to: Number(speed.value) }));
  const draw = () => {
    if (!source || bar.hidden) return;
    const width = canvas.clientWidth, ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(18 * ratio);
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    for (const [time, level] of marks) {
      const x = (time - source.start_s) / Math.max(source.end_s - source.start_s, 1e-3) * (width - 16) + 8;
      ctx.fillStyle = colour(level === "event" ? "dim" : level);
      ctx.beginPath();
      if (level === "event") ctx.rect(x - .75, 9, 1.5, 9);
      else if (level === "critical") ctx.rect(x - 3, 2, 6, 6);
      else { ctx.moveTo(x, 1); ctx.lineTo(x + 4, 8); ctx.lineTo(x - 4, 8); }
      ctx.fill();
    }
  };
  addEventListener("resize", draw);
  whenColoursChange(draw);
  const self = {
    node: bar,
    get recording() { return Boolean(source?.recording) && source.phase !== "reading"; },
    toggle() { if (self.recording) send({ cmd: source.phase === "playing" ? "pause" : "play" }); },
    seek(to) { if (self.recording) send({ cmd: "seek", to }); },
    step(by) { self.seek(now + by); },
    faster(by) {
      const index = SPEEDS.findIndex((value) => value >= source?.speed);
      if (self.recording) send({ cmd: "speed", to: SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, index + by))] });
    },
    marks(told) { if (told && told !== marks) { marks = told; draw(); } },
    update(head) {
      const first = source == null || source.end_s !== head.source.end_s || bar.hidden;
      source = head.source;
      now = head.now_s;
      bar.hidden = !self.recording;
      if (bar.hidden) return;
      const playing = source.phase === "playing";
      attribute(icon, "d", playing ? "M3.5 2.5h3v11h-3zM9.5 2.5h3v11h-3z" : "M4 2l10 6-10 6z");
      attribute(button, "aria-label", playing ? "Pause" : "Play");
      say(at, clock(now - source.start_s));
      say(end, clock(source.end_s - source.start_s));
      attribute(slider, "min", String(source.start_s));
      attribute(slider, "max", String(source.end_s));
      if (!dragging) slider.value = String(now);
      if (speed.value !== String(source.speed)) speed.value = String(source.speed);
      if (first) draw();
    },
  };
  return self;
};
