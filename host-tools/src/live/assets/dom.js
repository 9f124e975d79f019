// Small helpers. Everything that a vehicle sends goes onto the page as text, never as markup.

export const el = (name, attributes = {}, ...children) => {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") node.className = value;
    else if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value !== false && value != null) node.setAttribute(key, value === true ? "" : value);
  }
  for (const child of children.flat()) if (child != null) node.append(child);
  return node;
};

export const svg = (name, attributes = {}, ...children) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  for (const child of children.flat()) if (child != null) node.append(child);
  return node;
};

// Twenty times a second most things are as they were: only what changed is touched.
export const say = (node, text) => { if (node.textContent !== text) node.textContent = text; };
export const attribute = (node, name, value) => { if (node.getAttribute(name) !== value) node.setAttribute(name, value); };
export const toggle = (node, name, on) => { if (node.classList.contains(name) !== on) node.classList.toggle(name, on); };

const group = (text) => text.replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");
export const NONE = "\u2013";
export const fixed = (value, decimals) => {
  if (value == null || !Number.isFinite(value)) return NONE;
  const [before, after] = Number(value).toFixed(decimals).replace(/^-(?=[0.]*$)/, "").split(".");
  return group(before).replace("-", "\u2212") + (after ? "." + after : "");
};
export const whole = (value) => fixed(value, 0);
export const clock = (seconds) => {
  if (seconds == null || !Number.isFinite(seconds)) return NONE;
  const s = Math.floor(seconds), two = (n) => String(n).padStart(2, "0");
  return s >= 3600 ? `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}` : `${Math.floor(s / 60)}:${two(s % 60)}`;
};
export const age = (ms) => ms < 60000 ? `${Math.floor(ms / 1000)} s` : ms < 3600000 ? `${Math.floor(ms / 60000)} min` : `${Math.floor(ms / 3600000)} h`;
export const words = (name) => name.replace(/_/g, " ");

// A frame around an instrument: a title, a body, and a corner that says when it is out of date.
export const panel = (id, title, body, options = {}) => {
  const corner = el("span", { class: "corner" });
  const node = el("section", { class: `panel ${options.class ?? ""}`, "data-panel": id, "aria-label": title },
    el("h3", {}, el("span", { class: "name" }, title), options.unit ? el("small", {}, options.unit) : null, corner), body);
  return {
    node,
    // Takes values as the server sends them: [value, age in ms, 1 where that is stale].
    fresh(...shown) {
      const known = shown.filter(Boolean);
      const oldest = known.reduce((worst, value) => value[2] && value[1] > worst ? value[1] : worst, -1);
      toggle(node, "none", known.length === 0);
      toggle(node, "stale", oldest >= 0);
      say(corner, known.length === 0 ? "not sent" : oldest >= 0 ? `stale ${age(oldest)}` : "");
    },
  };
};

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
  const outer = svg("path", { class: "outer" }), inner = svg("path", { class: "inner" });
  return svg("svg", { class: "shape", viewBox: "0 0 16 16", "aria-hidden": "true" }, outer, inner);
};
export const shapeIs = (node, level) => {
  const [outer, inner] = SHAPES[level] ?? SHAPES.stale;
  attribute(node.firstChild, "d", outer);
  attribute(node.lastChild, "d", inner);
  attribute(node, "class", `shape ${level}`);
};
export const badge = () => {
  const mark = shape(), word = el("b");
  const node = el("span", { class: "badge" }, mark, word);
  return { node, set: (level, text = level) => { attribute(node, "class", `badge ${level}`); shapeIs(mark, level); say(word, text); } };
};
