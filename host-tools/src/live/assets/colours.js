// Colours as the style sheet has them, for what is drawn on a canvas.

const dark = matchMedia("(prefers-color-scheme: dark)");
let known = new Map();
const listeners = [];
dark.addEventListener("change", () => { known = new Map(); for (const listener of listeners) listener(); });

export const colour = (name) => {
  if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return known.get(name);
};
export const whenColoursChange = (listener) => listeners.push(listener);

// Told apart by colour-blind eyes, on light and on dark ground; each line has its number beside it too.
const LINES = [
  ["#2f6fb7", "#5aa2f0"], ["#d1495b", "#ff7a8a"], ["#1f8a4c", "#4cc27c"], ["#b8860b", "#e5b93c"],
  ["#2a9fb5", "#5fd0e6"], ["#a03a8a", "#dd78c6"], ["#6b7680", "#aab4be"], ["#8a5a2b", "#c99a68"],
  ["#4b4fae", "#9296f5"], ["#5f8f1f", "#a4d25a"], ["#c2571a", "#ff9a5c"], ["#177a76", "#4fc9c2"],
];
export const line = (index) => LINES[index % LINES.length][dark.matches ? 1 : 0];
