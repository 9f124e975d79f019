// A level as a shape, a colour and a word.

import { attribute, say } from "./dom.js";
import { el, svg } from "./elements.js";

// A level's shape: told apart without its colour.
const SHAPES = {
  ok: ["M8 1.5a6.5 6.5 0 1 0 0 13a6.5 6.5 0 1 0 0-13z", "M4.8 8.2l2.2 2.2 4.2-4.6"],
  advisory: ["M2.5 2.5h11v11h-11z", "M8 7.2v3.8M8 4.9v.2"],
  warning: ["M8 1.2l7 13.3H1z", "M8 6v4M8 12.1v.2"],
  critical: ["M5.2 1h5.6L15 5.2v5.6L10.8 15H5.2L1 10.8V5.2z", "M5.4 5.4l5.2 5.2M10.6 5.4l-5.2 5.2"],
  event: ["M2.2 3h11.6v7.6H8l-3.4 2.6v-2.6H2.2z", "M5 6.8h6"],
  stale: ["M8 1.5a6.5 6.5 0 1 0 0 13a6.5 6.5 0 1 0 0-13z", "M6.1 6.4a2 2 0 1 1 2.7 1.9c-.6.3-.8.6-.8 1.3M8 11.7v.2"],
};
export const shape = () => {
  const outer = svg("path", { class: "outer" }),
    inner = svg("path", { class: "inner" });
  return svg("svg", { class: "shape", viewBox: "0 0 16 16", "aria-hidden": "true" }, outer, inner);
};
export const shapeIs = (node, level) => {
  const [outer, inner] = SHAPES[level] ?? SHAPES.stale;
  attribute(node.firstChild, "d", outer);
  attribute(node.lastChild, "d", inner);
  attribute(node, "class", `shape ${level}`);
};
export const badge = () => {
  const mark = shape(),
    word = el("b");
  const node = el("span", { class: "badge" }, mark, word);
  return {
    node,
    set(level, text = level) {
      attribute(node, "class", `badge ${level}`);
      shapeIs(mark, level);
      say(word, text);
    },
  };
};
