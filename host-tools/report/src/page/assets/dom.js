// What changes on the page while it stands.

import { el } from "./elements.js";
import { age } from "./text.js";

// Twenty times a second most things are as they were: only what changed is touched.
export const say = (node, text) => {
  if (node.textContent !== text) node.textContent = text;
};
export const attribute = (node, name, value) => {
  if (node.getAttribute(name) !== value) node.setAttribute(name, value);
};
export const toggle = (node, name, on) => {
  if (node.classList.contains(name) !== on) node.classList.toggle(name, on);
};

// A frame around an instrument: a title, a body, and a corner that says when it is out of date.
export const panel = (id, title, body, options = {}) => {
  const corner = el("span", { class: "corner" });
  const node = el(
    "section",
    { class: `panel ${options.class ?? ""}`, "data-panel": id, "aria-label": title },
    el("h3", {}, el("span", { class: "name" }, title), options.unit ? el("small", {}, options.unit) : null, corner),
    body,
  );
  return {
    node,
    // Takes values as the server sends them: [value, age in ms, 1 where that is stale].
    fresh(...shown) {
      const known = shown.filter(Boolean);
      const oldest = known.reduce((worst, value) => (value[2] && value[1] > worst ? value[1] : worst), -1);
      toggle(node, "none", known.length === 0);
      toggle(node, "stale", oldest >= 0);
      say(corner, known.length === 0 ? "not sent" : oldest >= 0 ? `stale ${age(oldest)}` : "");
    },
  };
};
