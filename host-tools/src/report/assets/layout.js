// Sections with their places in the bar, and tables in them.

import { el } from "./elements.js";

export const main = document.getElementById("main");
export const bar = el("div");
document.getElementById("nav").append(bar);
export const section = (id, title) => {
  bar.append(el("a", { href: "#" + id }, title));
  const node = el("section", { id }, el("h2", {}, title));
  main.append(node);
  return node;
};
export const rows = (headings, body, options = {}) => el("table", options,
  el("thead", {}, el("tr", {}, headings.map(([text, kind]) => el("th", { class: kind || "", scope: "col" }, text)))),
  el("tbody", {}, body));
export const cells = (values, kinds, attributes = {}) => el("tr", attributes, values.map((value, i) => el("td", { class: kinds[i] || "" }, value)));
export const facts = (pairs) => el("dl", {}, pairs.filter(([, value]) => value != null && value !== "").flatMap(([key, value]) => [el("dt", {}, key), el("dd", {}, value)]));
