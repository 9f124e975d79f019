// A canvas as sharp as the screen, cleared; the look of axes.

import { colour } from "./colours.js";

export const FONT = "12px system-ui, 'DejaVu Sans', sans-serif";

export const canvas = (node, width, height) => {
  const ratio = devicePixelRatio || 1;
  if (node.width !== Math.round(width * ratio) || node.height !== Math.round(height * ratio)) {
    node.width = Math.round(width * ratio);
    node.height = Math.round(height * ratio);
  }
  const ctx = node.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = FONT;
  return ctx;
};

// The look of a plot's axis, with what is its own.
export const axis = (extra) => ({
  stroke: colour("dim"),
  font: FONT,
  grid: { stroke: colour("grid"), width: 1 },
  ticks: { stroke: colour("grid"), width: 1, size: 4 },
  ...extra,
});
