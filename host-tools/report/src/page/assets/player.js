// The time: play and pause, where it is, how fast; findings stand on the line. A recording is played by hums. A link goes on: this
// page keeps what it was told of the last minutes, and shows that while it is paused or rewound.

import { colour, whenColoursChange } from "./colours.js";
import { attribute, say } from "./dom.js";
import { el, svg } from "./elements.js";
import { flight, place } from "./flight.js";
import { clock } from "./text.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16, 32];
// States of a link that are kept: two a second, of ten minutes.
const KEPT_EVERY_S = 0.5,
  KEPT_MAX = 1200;
const PLAY = "M4 2l10 6-10 6z",
  PAUSE = "M3.5 2.5h3v11h-3zM9.5 2.5h3v11h-3z";

// `changed` is called when another moment is to be shown.
export const player = (send, changed) => {
  const icon = svg("path"),
    picture = svg("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, icon);
  const button = el("button", { type: "button", class: "play", onclick: () => self.toggle() }, picture);
  const at = el("output", { class: "at", "data-value": "now" }),
    end = el("span", { class: "dim" });
  const slider = el("input", { type: "range", min: 0, max: 1, step: 0.05, value: 0, "aria-label": "Time in the flight" });
  const canvas = el("canvas", { "aria-hidden": "true" });
  const speed = el(
    "select",
    { "aria-label": "Speed" },
    SPEEDS.map((value) => el("option", { value }, `${value}\u00d7`)),
  );
  const live = el("button", { type: "button", hidden: true, onclick: () => self.release() }, "back to now");
  const bar = el("div", { class: "bar-of-time", hidden: true }, button, at, el("div", { class: "line" }, canvas, slider), end, speed, live);
  let source = null,
    now = 0,
    dragging = false,
    marks = [],
    kept = [],
    held = null;
  slider.addEventListener("input", () => {
    dragging = true;
    self.seek(Number(slider.value));
  });
  slider.addEventListener("change", () => {
    dragging = false;
  });
  speed.addEventListener("change", () => send({ cmd: "speed", to: Number(speed.value) }));
  const range = () => (self.recording ? [source.start_s, source.end_s] : kept.length ? [kept[0].at, now] : [0, 1]);
  const draw = () => {
    if (!source || bar.hidden) return;
    const width = canvas.clientWidth,
      ratio = devicePixelRatio || 1,
      [from, to] = range();
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(18 * ratio);
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    for (const [time, level] of marks) {
      if (time < from) continue;
      const x = ((time - from) / Math.max(to - from, 1e-3)) * (width - 16) + 8;
      ctx.fillStyle = colour(level === "event" ? "dim" : level);
      ctx.beginPath();
      if (level === "event") ctx.rect(x - 0.75, 9, 1.5, 9);
      else if (level === "critical") ctx.rect(x - 3, 2, 6, 6);
      else {
        ctx.moveTo(x, 1);
        ctx.lineTo(x + 4, 8);
        ctx.lineTo(x - 4, 8);
      }
      ctx.fill();
    }
  };
  addEventListener("resize", draw);
  whenColoursChange(draw);
  const self = {
    node: bar,
    get recording() {
      return Boolean(source?.recording) && source.phase !== "reading";
    },
    // The state of the moment that is shown, where that is not now; null otherwise.
    get held() {
      return held?.state ?? null;
    },
    // Keeps the state of a link.
    keep(state, text) {
      if (!source || source.recording) return;
      if (kept.length && kept[0].vehicle !== state.vehicle) {
        kept = [];
        held = null;
      }
      if (kept.length && state.now_s - kept[kept.length - 1].at < KEPT_EVERY_S) return;
      kept.push({ at: state.now_s, vehicle: state.vehicle, text });
      if (kept.length > KEPT_MAX) kept.shift();
    },
    // A link's moment that was kept.
    hold(to) {
      const one =
        kept[
          Math.min(
            Math.max(
              place(kept, to, ({ at }) => at),
              0,
            ),
            kept.length - 1,
          )
        ];
      if (one) held = { at: one.at, state: JSON.parse(one.text) };
      changed();
    },
    release() {
      held = null;
      changed();
    },
    toggle() {
      if (self.recording) send({ cmd: source.phase === "playing" ? "pause" : "play" });
      else if (held) self.release();
      else self.hold(now);
    },
    seek(to) {
      if (self.recording) send({ cmd: "seek", to });
      else if (to >= now) self.release();
      else self.hold(to);
    },
    step(by) {
      self.seek((held?.at ?? now) + by);
    },
    faster(by) {
      const index = SPEEDS.findIndex((value) => value >= source?.speed);
      if (self.recording) send({ cmd: "speed", to: SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, index + by))] });
    },
    marks(told) {
      if (told && told !== marks) {
        marks = told;
        draw();
      }
    },
    update(head) {
      const first = source == null || source.end_s !== head.source.end_s || bar.hidden;
      source = head.source;
      now = head.now_s;
      bar.hidden = !self.recording && !kept.length;
      if (bar.hidden) return;
      const playing = self.recording ? source.phase === "playing" : !held,
        [from, to] = range(),
        shown = held?.at ?? now;
      attribute(icon, "d", playing ? PAUSE : PLAY);
      attribute(button, "aria-label", playing ? "Pause" : "Play");
      say(at, clock(shown - flight.start));
      say(end, self.recording ? clock(to - flight.start) : held ? `${clock(now - shown)} ago` : "now");
      attribute(slider, "min", String(from));
      attribute(slider, "max", String(to));
      if (!dragging) slider.value = String(shown);
      if (speed.value !== String(source.speed)) speed.value = String(source.speed);
      speed.hidden = !self.recording;
      live.hidden = !held;
      if (first) draw();
    },
  };
  return self;
};
