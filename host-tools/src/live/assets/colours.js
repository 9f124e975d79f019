// Colours as the style sheet has them, for what is drawn on a canvas.

import { lineColour } from "./lines.js";

const dark = matchMedia("(prefers-color-scheme: dark)");
let known = new Map();
const listeners = [];
dark.addEventListener("change", () => { known = new Map(); for (const listener of listeners) listener(); });

export const colour = (name) => {
  if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return known.get(name);
};
export const whenColoursChange = (listener) => listeners.push(listener);

export const line = (index) => lineColour(index, dark.matches);
