// Findings, what the vehicle says, and what happened.

import { badge } from "./badge.js";
import { panel, toggle } from "./dom.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { moment, plural } from "./text.js";
import { utc } from "./view.js";

// `rows` are on the page at most, the newest first or last. A click on one goes there.
export const notes = ({ go, newestFirst, rows = Infinity }) => {
  const list = el("ol", { class: "notes" });
  const live = el("div", { role: "log", "aria-live": newestFirst ? "polite" : "off", "aria-relevant": "additions" }, list);
  const empty = el("p", { class: "dim empty" }, "Nothing yet: every change of a check's level stands here.");
  const more = el("p", { class: "dim", hidden: true });
  let only = false,
    shown = null,
    count = 0;
  const filter = el("button", { type: "button", "aria-pressed": "false", onclick: () => show(!only) }, "findings only");
  const show = (on) => {
    only = on;
    filter.setAttribute("aria-pressed", String(only));
    toggle(list, "only", only);
  };
  const box = panel("notes", "Findings and messages", [live, empty, more], { class: "tall" });
  box.node.firstChild.append(filter);
  // What a finding explains stands with it: by check, while its alarm lasts. What was seen before its cause waits.
  let causes = new Map(),
    waiting = new Map();
  const explain = (cause, words) => {
    if (cause.effects.includes(words)) return;
    cause.effects.push(words);
    cause.node.hidden = false;
    cause.node.textContent = `Consequences: ${cause.effects.join(", ")}`;
  };
  const follows = ({ level, words, found }) => {
    if (found.because && level !== "ok") {
      const { check } = found.because;
      if (causes.has(check)) explain(causes.get(check), words);
      else waiting.set(check, [...(waiting.get(check) ?? []), words]);
    }
    if (level === "ok" || level === "advisory") {
      causes.delete(found.check);
      return null;
    }
    const cause = { node: el("p", { class: "why consequences", hidden: true }), effects: [] };
    causes.set(found.check, cause);
    for (const effect of waiting.get(found.check) ?? []) explain(cause, effect);
    waiting.delete(found.check);
    return cause.node;
  };
  const row = (note) => {
    const level = badge(),
      { found } = note;
    // What is only said is no level of anything.
    const plain = note.kind === "event" || (note.kind === "text" && note.level === "ok");
    if (found?.ended) level.set("stale", "ended");
    else level.set(plain ? "event" : note.level, note.kind === "event" ? "event" : plain ? "says" : note.level);
    const from = note.from === "here" ? note.subsystem : note.from;
    return el(
      "li",
      { class: `${note.kind} ${note.level}`, "data-at": note.at_s, "data-check": found?.check },
      el(
        "button",
        { type: "button", class: "when", title: utc(note.at_s) && `${utc(note.at_s)} UTC` },
        el("time", {}, moment(note.at_s - flight.zero)),
      ),
      level.node,
      el("span", { class: "words" }, note.words),
      el("small", {}, [from, found?.measured].filter(Boolean).join(" \u00b7 ")),
      found?.because ? el("p", { class: "why because" }, `Because of: ${found.because.words}`) : null,
      found?.meaning ? el("p", { class: "why" }, found.meaning, " ", el("b", {}, found.action)) : null,
      found ? follows(note) : null,
    );
  };
  list.addEventListener("click", (event) => {
    const at = event.target.closest("li")?.dataset.at;
    if (at) go(Number(at));
  });
  return {
    node: box.node,
    // After a part of the flight: everything anew, or what is new.
    update(anew = false) {
      if (anew || flight.notes !== shown || flight.notes.length < count) {
        list.replaceChildren();
        causes = new Map();
        waiting = new Map();
        count = 0;
        shown = flight.notes;
      }
      const fresh = flight.notes.slice(Math.max(count, flight.notes.length - rows)).map(row);
      if (newestFirst) list.prepend(...fresh.reverse());
      else list.append(...fresh);
      while (list.children.length > rows) list.lastChild.remove();
      count = flight.notes.length;
      empty.hidden = count > 0;
      more.hidden = !flight.notesGone;
      more.textContent = `${plural(flight.notesGone, "earlier one is", "earlier ones are")} not listed.`;
    },
    only: show,
  };
};
