// Colours as the style sheet has them, for what is drawn on a canvas. Paper is always light.

const root = document.documentElement;
const dark = matchMedia("(prefers-color-scheme: dark)");
let known = new Map();
const listeners = [];

// Paul Tol's bright and muted schemes, on light and on dark ground: told apart by colour-blind eyes.
const LINES = [
  ["#2f6fb7", "#5aa2f0"],
  ["#d1495b", "#ff7a8a"],
  ["#1f8a4c", "#4cc27c"],
  ["#b8860b", "#e5b93c"],
  ["#2a9fb5", "#5fd0e6"],
  ["#a03a8a", "#dd78c6"],
  ["#6b7680", "#aab4be"],
  ["#8a5a2b", "#c99a68"],
  ["#4b4fae", "#9296f5"],
  ["#5f8f1f", "#a4d25a"],
  ["#c2571a", "#ff9a5c"],
  ["#177a76", "#4fc9c2"],
  ["#7f3f3f", "#d49a9a"],
  ["#3f6f7f", "#8fc3d4"],
];
export const isDark = () => !root.classList.contains("printing") && dark.matches;
export const line = (index) => LINES[index % LINES.length][isDark() ? 1 : 0];

export const PHASES = {
  ground: "#747e88",
  take_off: "#b5661a",
  hover: "#2f78b8",
  climb: "#37874a",
  cruise: "#7a68c9",
  descent: "#927008",
  landing: "#c04f71",
};
// Modes have no order and no meaning here: their colours only tell one from the next.
export const modeColour = (name) => {
  let sum = 0;
  for (const letter of name) sum = (sum * 31 + letter.codePointAt(0)) % 360;
  return `hsl(${sum} 42% 36%)`;
};

export const colour = (name) => {
  if (!known.has(name)) known.set(name, getComputedStyle(root).getPropertyValue(`--${name}`).trim());
  return known.get(name);
};
export const whenColoursChange = (listener) => listeners.push(listener);

const change = () => {
  known = new Map();
  for (const listener of listeners) listener();
};
export const printing = (on) => {
  root.classList.toggle("printing", on);
  change();
};
dark.addEventListener("change", change);
