// Findings as they come, what the vehicle says, and what happened: the newest first.

import { badge } from "./badge.js";
import { panel, toggle } from "./dom.js";
import { el } from "./elements.js";
import { clock } from "./shown.js";

// Rows on the page at most; the server keeps more.
const ROWS_MAX = 200;

export const notes = (seek) => {
  const list = el("ol", { class: "notes", role: "log", "aria-live": "polite", "aria-relevant": "additions" });
  const empty = el("p", { class: "dim empty" }, "Nothing yet: every change of a check's level stands here.");
  let only = false, start = 0, shown = null, count = 0;
  const filter = el("button", { type: "button", "aria-pressed": "false", onclick: () => { only = !only; filter.setAttribute("aria-pressed", String(only)); toggle(list, "only", only); } }, "findings");
  const box = panel("notes", "Findings and messages", [list, empty], { class: "tall" });
  box.node.firstChild.append(filter);
  const row = (note) => {
    const level = badge();
    // What is only said is no level of anything.
    const plain = note.kind === "event" || (note.kind === "text" && note.level === "ok");
    level.set(plain ? "event" : note.level, note.kind === "event" ? "event" : plain ? "says" : note.level);
    const from = note.from === "here" ? note.subsystem : note.from;
    return el("li", { class: `${note.kind} ${note.level}` }, el("time", {}, clock(note.at_s - start)), level.node,
      el("span", { class: "words" }, note.words), from ? el("small", {}, from) : null);
  };
  list.addEventListener("click", (event) => {
    const index = [...list.children].indexOf(event.target.closest("li"));
    const note = shown?.notes[count - 1 - index];
    if (index >= 0 && note) seek(note.at_s);
  });
  return {
    node: box.node,
    // After a part of the history: everything anew, or what is new on top.
    update(history, from, anew) {
      start = from;
      if (anew || history !== shown || history.notes.length < count) { list.replaceChildren(); count = 0; shown = history; }
      const fresh = history.notes.slice(Math.max(count, history.notes.length - ROWS_MAX));
      list.prepend(...fresh.map(row).reverse());
      while (list.children.length > ROWS_MAX) list.lastChild.remove();
      count = history.notes.length;
      empty.hidden = count > 0;
    },
  };
};
