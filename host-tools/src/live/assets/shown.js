// Values as the page shows them.

import { digits, hours } from "./text.js";

export const NONE = "\u2013";
export const fixed = (value, decimals) => value == null || !Number.isFinite(value) ? NONE : digits(value, decimals).replace("-", "\u2212");
export const whole = (value) => fixed(value, 0);
export const clock = (seconds) => seconds == null || !Number.isFinite(seconds) ? NONE : hours(Math.floor(seconds));
export const age = (ms) => ms < 60000 ? `${Math.floor(ms / 1000)} s` : ms < 3600000 ? `${Math.floor(ms / 60000)} min` : `${Math.floor(ms / 3600000)} h`;
