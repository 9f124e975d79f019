// What the vehicle said, and what it sent.

import { data, log, start } from "./data.js";
import { el } from "./elements.js";
import { fixed, whole } from "./format.js";
import { cells, rows, section } from "./layout.js";

const SEVERITIES = ["emergency", "alert", "critical", "error", "warning", "notice", "info", "debug"];
const levelOf = (severity) => severity <= 3 ? "critical" : severity === 4 ? "warning" : severity === 5 ? "advisory" : "stale";

export const messagesSection = () => {
  const said = section("messages", "Messages");
  said.append(el("div", { class: "split" },
    el("div", { class: "panel scroll tall" }, data.texts.length
      ? rows([["Time", "n"], ["Severity"], ["Text"]], data.texts.map((t) => cells([
        fixed(t.at_s - start, 1) + " s", el("span", { class: `badge ${levelOf(t.severity)}` }, SEVERITIES[t.severity] ?? String(t.severity)), t.text],
        ["n", "t", "words"], { class: "text" })))
      : el("p", { class: "dim" }, "The vehicle said nothing in words."),
      data.texts_count > data.texts.length ? el("p", { class: "dim" }, `and ${whole(data.texts_count - data.texts.length)} more`) : null),
    el("div", { class: "panel scroll tall" }, rows([["Message"], ["Frames", "n"], ["per s", "n"]], [...log.messages].sort((a, b) => b.frames - a.frames).map((m) =>
      cells([m.name + (m.verified ? "" : " (unverified)"), whole(m.frames), fixed(m.frames / Math.max(log.duration_s, 1), 2)], ["words", "n", "n"]))))));
};
