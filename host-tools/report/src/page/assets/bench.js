// The bench check.

import { badge } from "./badge.js";
import { panel, say } from "./dom.js";
import { el } from "./elements.js";
import { cells, facts, rows } from "./layout.js";

const LEVELS = { ok: "ok", missing: "critical", unknown: "stale" };

const line = ({ check, state, detail }) => {
  const level = badge();
  level.set(LEVELS[state], state);
  return el("li", { class: LEVELS[state] }, el("b", {}, check), level.node, el("div", {}, el("span", { class: "reason" }, detail)));
};

const parts = ({ system, checks, settings, wiring }, port, link) => [
  el("ul", { class: "board" }, checks.map(line)),
  settings.length ? el("h4", {}, "Parameters of the autopilot") : null,
  settings.length
    ? rows(
        [["parameter"], ["now", "n"], ["wanted", "n"], ["because"]],
        settings.map(({ name, now, wanted, at_least, why }) =>
          cells([name, now == null ? "-" : String(now), `${at_least ? "at least " : ""}${wanted}`, why], ["", "n", "n", ""]),
        ),
      )
    : null,
  el("p", { class: "small" }, "The page sets nothing. To set them, stop hums and type:"),
  el("p", { class: "small" }, el("code", {}, `hums box setup --link ${link} --system ${system} --port ${port} --set --undo before.param`)),
  wiring.length ? el("h4", {}, "Wiring of the board") : null,
  facts(wiring.map(({ wire, pad }) => [wire, pad])),
];

export const bench = (start, link) => {
  const verdict = badge(),
    button = el("button", { type: "button", onclick: start }, "Check"),
    found = el("div");
  const { node } = panel("bench", "Bench check", [el("p", { class: "recorder" }, verdict.node, button), found]);
  let told = null;
  node.hidden = true;
  return {
    node,
    take(message) {
      told = message;
      const { words, found: result, port } = told,
        isRunning = words === "checking";
      verdict.set(!result ? "stale" : result.ready ? "ok" : "critical", result ? `system ${result.system}: ${words}` : words);
      say(button, isRunning ? "Checking" : "Check");
      button.disabled = isRunning;
      found.replaceChildren(...(result ? parts(result, port, link()).filter(Boolean) : []));
    },
    update(isShown) {
      node.hidden = !told || !isShown;
    },
  };
};
