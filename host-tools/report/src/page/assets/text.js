// Numbers, times and names as text.

const NONE = "\u2013";

// Thousands apart, by a narrow space that does not break.
export const grouped = (text) => text.replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");

export const fixed = (value, decimals) => {
  if (value == null || !Number.isFinite(Number(value))) return NONE;
  const [before, after] = Number(value)
    .toFixed(decimals)
    .replace(/^-(?=[0.]*$)/, "")
    .split(".");
  return (grouped(before) + (after ? `.${after}` : "")).replace("-", "\u2212");
};
export const whole = (value) => fixed(value, 0);

// Whole seconds as 1:02:03, or 2:03.
export const clock = (seconds) => {
  if (seconds == null || !Number.isFinite(seconds)) return NONE;
  const s = Math.floor(Math.abs(seconds)),
    sign = seconds <= -1 ? "\u2212" : "",
    two = (n) => String(n).padStart(2, "0");
  return (
    sign + (s >= 3600 ? `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}` : `${Math.floor(s / 60)}:${two(s % 60)}`)
  );
};
// A time of a recording, to the nearest tenth of a second, as hums check has it: 4:20.8.
export const moment = (seconds) => {
  const tenths = Math.round(Math.abs(seconds) * 10);
  return `${clock(Math.sign(seconds) * Math.floor(tenths / 10))}.${tenths % 10}`;
};
export const span = (seconds) => clock(Math.round(seconds));
export const age = (ms) =>
  ms < 60000 ? `${Math.floor(ms / 1000)} s` : ms < 3600000 ? `${Math.floor(ms / 60000)} min` : `${Math.floor(ms / 3600000)} h`;
export const bytes = (n) => (n >= 1e6 ? `${fixed(n / 1e6, 1)} MB` : n >= 1e3 ? `${fixed(n / 1e3, 1)} kB` : `${n} B`);
export const plural = (n, one, many) => `${whole(n)} ${n === 1 ? one : many || `${one}s`}`;
export const counted = (n, level) => (level === "warning" ? plural(n, level) : `${whole(n)} ${level}`);
export const words = (name) => name.replace(/_/g, " ");

// As many digits as tell something.
export const short = (value) => String(Number(Number(value).toPrecision(5)));
