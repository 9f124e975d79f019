// Who flew, when, and the verdict.

import { findings, log, name } from "./data.js";
import { el } from "./elements.js";
import { LEVELS, span } from "./format.js";

export const head = () => {
  const rank = (level) => LEVELS.indexOf(level);
  const worst = findings.reduce((worst, f) => rank(f.level) > rank(worst) ? f.level : worst, "ok");
  const count = (level) => findings.filter((f) => f.level === level).length;
  const verdict = log.checked_by === "nobody" || (log.format !== "hums" && !log.vehicle) ? "Not checked" : worst === "ok" ? "No findings"
    : ["critical", "warning", "stale", "advisory"].filter(count).map((level) => `${count(level)} ${level}`).join(", ");
  const host = document.getElementById("head");
  const when = log.start_utc ? `${log.start_utc.slice(0, 10)} ${log.start_utc.slice(11, 19)} UTC` : "time of day unknown";
  document.title = `${name}, ${log.format === "hums" ? "session " : ""}${log.name}, ${when}`;
  host.append(
    el("h1", {}, name),
    el("p", { class: "dim" }, log.format === "hums"
      ? `Session ${log.name} \u00b7 ${when} \u00b7 ${span(log.duration_s)} \u00b7 ${log.end.words}`
      : `${log.name} \u00b7 ${when} \u00b7 ${span(log.duration_s)}`),
    el("p", { class: `verdict ${worst}`, id: "verdict" }, verdict),
  );

};
