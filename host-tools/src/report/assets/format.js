// How numbers, times, levels and phases are shown.

import { data } from "./data.js";
import { digits, grouped, hours } from "./text.js";
import { lineColour } from "./lines.js";

const root = document.documentElement;

export const whole = (value) => grouped(String(Math.round(value)));
export const fixed = digits;
export const span = (seconds) => hours(Math.round(seconds));
export const bytes = (n) => n >= 1e6 ? fixed(n / 1e6, 1) + " MB" : n >= 1e3 ? fixed(n / 1e3, 1) + " kB" : n + " B";
export const plural = (n, one, many) => `${whole(n)} ${n === 1 ? one : many || one + "s"}`;
const utc = (seconds) => data.epoch_us == null ? null : new Date(data.epoch_us / 1000 + seconds * 1000);
export const clock = (seconds) => utc(seconds)?.toISOString().slice(11, 19) ?? null;

// From the best to the worst.
export const LEVELS = ["ok", "advisory", "stale", "warning", "critical"];
export const PHASES = {
  "ground": "#8a949e", "take_off": "#d9822b", "hover": "#3f8fd2", "climb": "#4fae62", "cruise": "#7a68c9",
  "descent": "#d0a215", "landing": "#c65b7c",
};
export const phaseName = (phase) => phase.replace("_", "-");

// Colours as the style sheet has them, for what is drawn on a canvas. Paper is always light.
export const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
export const dark = () => !root.classList.contains("printing") && matchMedia("(prefers-color-scheme: dark)").matches;
export const line = (index) => lineColour(index, dark());
