// A table that is sorted by any of its columns, and narrowed by a word.

import { el } from "./elements.js";
import { plural } from "./text.js";

// Rows on the page at most: a browser takes seconds for ten thousand.
const ROWS_MAX = 500;

// `columns`: title, kind of cell, what it is sorted by, what stands there. The first sorting is by column `by`.
export const sorted = (id, items, columns, { by = 0, placeholder, label }) => {
  let down = true;
  const body = el("tbody");
  const word = el("input", { type: "search", placeholder, "aria-label": label });
  const more = el("p", { class: "dim" });
  const heads = columns.map(([title, kind], i) => {
    const button = el("button", { type: "button", class: "sort", onclick: () => sort(i) }, title);
    return el("th", { class: kind === "n" ? "n" : "", scope: "col" }, button);
  });
  const node = (item) =>
    el(
      "tr",
      {},
      columns.map(([title, kind, , shown]) => el("td", { class: kind, "data-title": title }, shown(item))),
    );
  const rows = items.map((item) => ({ item, node: null }));
  const has = (row, part) => {
    row.node ??= node(row.item);
    return row.node.textContent.toLowerCase().includes(part);
  };
  const draw = () => {
    const key = columns[by][2];
    rows.sort((one, other) => {
      const [a, b] = [key(one.item), key(other.item)];
      return (a < b ? -1 : a > b ? 1 : 0) * (down ? -1 : 1);
    });
    const part = word.value.toLowerCase();
    const found = part ? rows.filter((row) => has(row, part)) : rows;
    const shown = found.slice(0, ROWS_MAX).filter((row) => has(row, ""));
    body.replaceChildren(...shown.map(({ node }) => node));
    more.textContent = found.length > ROWS_MAX ? `${plural(found.length - ROWS_MAX, "more row")}: narrow the table by a word.` : "";
    heads.forEach((head, i) => {
      head.setAttribute("aria-sort", i !== by ? "none" : down ? "descending" : "ascending");
    });
  };
  const sort = (column) => {
    down = column === by ? !down : columns[column][1] !== "words";
    by = column;
    draw();
  };
  word.addEventListener("input", draw);
  draw();
  return [word, el("div", { class: "panel scroll cards", id }, el("table", {}, el("thead", {}, el("tr", {}, heads)), body)), more];
};
