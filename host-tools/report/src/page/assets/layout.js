// Sections with their places in the bar, and tables in them.

import { el } from "./elements.js";

export const main = document.getElementById("main");
export const isFramed = location.href.startsWith("about:");
export const bar = el("div");
document.getElementById("nav").append(bar);
// `host` is where it stands, `before` which one it stands before.
export const section = (id, title, host = main, before = null) => {
  // Inside the check in a browser a fragment would be one of the page around.
  const scroll = (event) => {
    if (!isFramed) return;
    event.preventDefault();
    node.scrollIntoView();
  };
  const link = el("a", { href: `#${id}`, onclick: scroll }, title);
  bar.insertBefore(link, before ? bar.querySelector(`[href="#${before.id}"]`) : bar.querySelector(".back"));
  const node = el("section", { id, class: "row" }, el("h2", {}, title));
  host.insertBefore(node, before);
  return node;
};
export const rows = (headings, body, options = {}) =>
  el(
    "table",
    options,
    el(
      "thead",
      {},
      el(
        "tr",
        {},
        headings.map(([text, kind]) => el("th", { class: kind || "", scope: "col" }, text)),
      ),
    ),
    el("tbody", {}, body),
  );
// With `titles` a row may become a card.
export const cells = (values, kinds, attributes = {}, titles = []) =>
  el(
    "tr",
    attributes,
    values.map((value, i) => el("td", { class: kinds[i] || "", "data-title": titles[i] }, value)),
  );
export const facts = (pairs) =>
  el(
    "dl",
    { class: "list" },
    pairs.filter(([, value]) => value != null && value !== "").flatMap(([key, value]) => [el("dt", {}, key), el("dd", {}, value)]),
  );
