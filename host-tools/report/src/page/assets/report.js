// The page of a flight that is whole, from top to bottom.

import { data, log, name } from "./data.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { bar, cells, main, rows, section } from "./layout.js";
import { map } from "./map.js";
import { notes } from "./notes.js";
import { parameters } from "./parameters.js";
import { charts } from "./plot.js";
import { plots } from "./plots.js";
import { recorderSection } from "./recorder.js";
import { spectrumSection } from "./spectrum.js";
import { summary } from "./summary.js";
import { fixed, moment, plural, span, whole } from "./text.js";
import { timeline } from "./timeline.js";
import { trendSection } from "./trend.js";
import { usageSection } from "./usage.js";
import { back, cursorTime, home, lookAt, usually, zoom } from "./view.js";

const root = document.documentElement;

// ---- Who flew, when, and the verdict.
const findings = flight.notes.filter(({ kind, found }) => kind === "finding" && found);
const unjudged = log.format !== "hums" && !log.vehicle;
const isChecked = log.checked_by !== "nobody" && !unjudged;
const worst = data.critical ? "critical" : data.warning ? "warning" : data.judged && !data.little ? "ok" : "stale";
// Of a recording of frames alone it is the first of them.
const POWER_ON = "the autopilot's power-on";
const ZEROS = { hums: "the box's power-on", dataflash: POWER_ON, ulog: POWER_ON };
const when = log.start_utc ? `${log.start_utc.slice(0, 10)} ${log.start_utc.slice(11, 19)} UTC` : "time of day unknown";
const session = log.format === "hums" ? "session " : "";
document.title = `${name}, ${session}${log.name}, ${when}`;
document
  .getElementById("head")
  .append(
    el("h1", {}, name),
    el(
      "p",
      { class: "dim" },
      [`${session}${log.name}`, when, span(log.duration_s), log.format === "hums" ? log.end.words : ""].filter(Boolean).join(" \u00b7 "),
    ),
    el("p", { class: `verdict ${isChecked ? worst : "stale"}`, id: "verdict" }, isChecked ? data.verdict : "Not checked"),
    data.judged && data.judged[0] < data.judged[1]
      ? el(
          "p",
          { class: "dim", id: "unjudged" },
          `Not judged: ${data.judged[1] - data.judged[0]} of ${data.judged[1]} checks, which lack data.`,
        )
      : "",
    data.missing.length
      ? el(
          "p",
          { class: "verdict warning", id: "missing" },
          `${data.missing[0].from_s == null ? "" : `${moment(data.missing[0].from_s - flight.zero)}: `}${data.missing[0].words}`,
          data.missing.length > 1 ? `; and ${plural(data.missing.length - 1, "more place")}` : "",
        )
      : "",
    data.ends_in_air
      ? el("p", { class: "verdict warning", id: "ends" }, `${moment(data.ends_in_air[0] - flight.zero)}: ${data.ends_in_air[1]}`)
      : "",
  );
bar.append(back);

// ---- Sections.
summary((from, to) => {
  zoom(from, to);
  document.getElementById("time").scrollIntoView({ behavior: "smooth" });
});
const found = section("findings", "Findings and messages");
const list = notes({
  go: (at) => {
    lookAt(at);
    document.getElementById("time").scrollIntoView({ behavior: "smooth" });
  },
  newestFirst: false,
});
list.update();
list.only(findings.length > 0);
const unlisted = log.findings_count - findings.length,
  unsaid = data.texts_count - flight.notes.filter(({ kind, found }) => kind !== "event" && !found).length;
found.append(
  list.node,
  ...[
    findings.length
      ? ""
      : unjudged
        ? "Nothing was judged: no autopilot was heard in this recording."
        : log.checked_by === "nobody"
          ? "Not checked: what recorded this ran no checks."
          : data.judged
            ? `${data.judged[0]} of ${data.judged[1]} checks had data, and nothing was wrong there.`
            : "Nothing was found.",
    unlisted > 0 ? `And ${plural(unlisted, "finding")} more.` : "",
    unsaid > 0 ? `And ${plural(unsaid, "text")} more.` : "",
    log.checked_by === "hums" ? "HUMS checked this log now; its recorder ran no checks." : "",
  ]
    .filter(Boolean)
    .map((text) => el("p", { class: "dim" }, text)),
);

const time = section("time", "Timeline and track"),
  strip = timeline(),
  track = map();
time.append(
  strip.node,
  flight.track.length
    ? el("div", { class: "panel" }, track.node, track.legend)
    : el("p", { class: "dim" }, "The vehicle never knew where it was: there is no track."),
  cursorTime,
);
usually(() => [flight.start, flight.end]);
plots((group) => section(group.toLowerCase(), group), { folds: true }).update();
spectrumSection();

const told = parameters(data.before);
told.update();
section("parameters", "Parameters").append(told.node);
usageSection();
trendSection();
recorderSection();
section("sent", "Messages sent").append(
  el(
    "div",
    { class: "panel scroll" },
    rows(
      [["Message"], ["Frames", "n"], ["per s", "n"]],
      [...log.messages]
        .sort((a, b) => b.frames - a.frames)
        .map((m) =>
          cells(
            [m.name + (m.verified ? "" : " (unverified)"), whole(m.frames), fixed(m.frames / Math.max(log.duration_s, 1), 2)],
            ["words", "n", "n"],
          ),
        ),
    ),
  ),
);
document
  .getElementById("foot")
  .append(
    `Made by hums ${data.version}. Times count from ${ZEROS[log.format] ?? "the first frame"}; intervals of ${
      flight.step >= 1 ? `${flight.step} s` : `${flight.step * 1000} ms`
    } keep their lowest and highest value. Plots: uPlot, MIT.`,
  );

addEventListener("keydown", (event) => event.key === "Escape" && home());

// ---- Redrawing.
const draw = () => {
  for (const one of charts) one.draw();
  strip.update(true);
  track.update(null, true);
};
draw();
root.dataset.ready = String(main.children.length > 0);
