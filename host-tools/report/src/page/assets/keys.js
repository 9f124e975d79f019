// The keyboard: everything that a click does.

import { el } from "./elements.js";
import { home } from "./view.js";

const HELP = [
  ["Space", "play or pause; a link goes on meanwhile"],
  ["\u2190 \u2192", "5 seconds back or on; with Shift 30"],
  ["Home End", "the beginning or the end: of a link now"],
  ["[ ]", "slower or faster"],
  ["W", "plots: 1 min, 5 min, whole flight"],
  ["Esc", "plots: back from looking closer"],
  ["M", "sound on or off"],
  ["1 \u2026 8", "another vehicle"],
  ["?", "this help"],
];

// Where the choice to have no keys outlives the page; a browser may refuse that.
const STORED = "hums-keys";
const stored = () => {
  try {
    return localStorage.getItem(STORED);
  } catch {
    return null;
  }
};
const store = (value) => {
  try {
    localStorage.setItem(STORED, value);
  } catch {
    // Then it holds until the page is left.
  }
};

export const keys = ({ player, sound, window: nextWindow, vehicle }) => {
  const on = el("input", { type: "checkbox", id: "keys-on", onchange: () => store(on.checked ? "on" : "off") });
  on.checked = stored() !== "off";
  const dialog = el(
    "dialog",
    { "aria-label": "Keys" },
    el("h2", {}, "Keys"),
    el(
      "dl",
      { class: "keys-help" },
      HELP.flatMap(([key, does]) => [
        el(
          "dt",
          {},
          key.split(" ").map((one) => (one === "\u2026" ? one : el("kbd", {}, one))),
        ),
        el("dd", {}, does),
      ]),
    ),
    el("p", {}, el("label", {}, on, " Keys do this")),
    el("p", { class: "dim" }, "A click on a finding goes to it. Nothing here is sent to the vehicle."),
    el("form", { method: "dialog" }, el("button", {}, "Close")),
  );
  document.body.append(dialog);
  const help = () => (dialog.open ? dialog.close() : dialog.showModal());
  // The policy forbids forms to go anywhere; this one only closes.
  dialog.querySelector("button").addEventListener("click", (event) => {
    event.preventDefault();
    dialog.close();
  });
  const does = {
    " ": () => player.toggle(),
    ArrowLeft: (event) => player.step(event.shiftKey ? -30 : -5),
    ArrowRight: (event) => player.step(event.shiftKey ? 30 : 5),
    Home: () => player.seek(0),
    End: () => player.seek(1e12),
    "[": () => player.faster(-1),
    "]": () => player.faster(1),
    w: nextWindow,
    m: sound,
    "?": help,
    Escape: home,
  };
  addEventListener("keydown", (event) => {
    if (!on.checked || event.ctrlKey || event.metaKey || event.altKey || event.target.matches?.("select, input")) return;
    if (event.key === " " && event.target.matches?.("button")) return;
    // An open help takes Esc itself: the browser closes it.
    if (event.key === "Escape" && dialog.open) return;
    const one = does[event.key] ?? does[event.key.toLowerCase()];
    if (one) {
      event.preventDefault();
      one(event);
    } else if (/^[1-8]$/.test(event.key)) vehicle(Number(event.key) - 1);
  });
  return { help };
};
