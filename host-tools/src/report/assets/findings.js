// What the checks found.

import { end, findings, log, start } from "./data.js";
import { el } from "./elements.js";
import { point } from "./charts.js";
import { clock, fixed, whole } from "./format.js";
import { cells, rows, section } from "./layout.js";
import { words } from "./text.js";
import { zoom } from "./view.js";

const value = (f) => f.state ?? (f.value == null ? "" : `${Number(f.value.toPrecision(5))} ${f.unit}`);
// The limit of a state is a number between two of them.
const limit = (f) => f.limit == null || f.state ? "" : `${Number(f.limit.toPrecision(5))} ${f.unit}`;
const lookAt = (at) => {
  const half = Math.max(15, (end - start) / 20);
  zoom(at - half, at + half);
  setTimeout(() => point(at), 50);
};

export const findingsSection = () => {
  const found = section("findings", "Findings");
  found.append(findings.length ? el("div", { class: "panel scroll tall" }, rows(
    [["Time", "n"], ["UTC"], ["Level"], ["Check"], ["Was"], ["Value", "n"], ["Limit", "n"]],
    findings.map((f) => cells([
      fixed(f.time_s - start, 1) + " s", clock(f.time_s) ?? "", el("span", { class: `badge ${f.level}` }, f.level),
      `${f.subsystem}: ${words(f.check)}${f.instance ? " " + (f.instance + 1) : ""}`, f.previous, value(f), limit(f),
    ], ["n", "t", "t", "", "t", "n", "n"], {
      class: "go finding", tabindex: 0, onclick: () => lookAt(f.time_s), onkeydown: (e) => e.key === "Enter" && lookAt(f.time_s),
    }))), log.findings_count > findings.length ? el("p", { class: "dim" }, `and ${whole(log.findings_count - findings.length)} more`) : null)
    : el("p", { class: "dim" }, log.format !== "hums" && !log.vehicle ? "Nothing was judged: no autopilot was heard in this recording."
      : log.checked_by === "nobody" ? "Not checked: what recorded this ran no checks."
      : "Every check stayed within its limits, or had nothing to look at."));
  if (log.checked_by === "hums") found.append(el("p", { class: "dim" },
    "Checked when this page was made: what recorded this ran no checks."));
};
