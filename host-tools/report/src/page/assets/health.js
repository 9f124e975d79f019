// The health board, usage and what is due, recorder and link.

import { badge } from "./badge.js";
import { say, attribute, toggle, panel } from "./dom.js";
import { el } from "./elements.js";
import { fixed, whole, span, age } from "./text.js";

export const board = () => {
  const list = el("ul", { class: "board" });
  const box = panel("board", "Health", list);
  const rows = new Map();
  // A subsystem has its row from its first report on, in the order of the reports.
  const row = (name) => {
    if (!rows.has(name)) {
      const level = badge(),
        reason = el("span", { class: "reason" }),
        by = el("small");
      const node = el("li", { "data-subsystem": name }, el("b", {}, name), level.node, el("div", {}, by, reason));
      rows.set(name, { node, level, reason, by });
      list.append(node);
    }
    return rows.get(name);
  };
  return {
    node: box.node,
    update({ board: parts }) {
      for (const part of parts) {
        const { node, level, reason, by } = row(part.subsystem);
        level.set(part.level, part.calm ?? part.level);
        say(reason, part.reason);
        say(by, part.by === "on board" ? "on board" : "");
        attribute(node, "class", part.level);
      }
    },
  };
};

const DUE = { green: ["ok", "good"], yellow: ["warning", "soon"], red: ["critical", "due"] };
const counted = ({ value, unit, decimals }) => (unit === "s" ? span(value) : decimals ? fixed(value, decimals) : whole(value));

export const usage = () => {
  const list = el("dl", { class: "facts two" });
  let rows = [];
  const row = ({ name, title, unit }) => {
    const number = el("b", { "data-value": `usage:${name}` });
    const shown = unit === "s" ? "" : unit;
    return { number, node: el("div", { class: "fact" }, el("dt", {}, title), el("dd", {}, number, shown ? ` ${shown}` : "")) };
  };
  const due = el("ul", { class: "due" });
  const none = el(
    "p",
    { class: "dim small" },
    "No part is described. A log tells its own, a box on the link does when it is asked for its parameters, or a file does: ",
    el("span", { class: "word" }, "--params"),
    ".",
  );
  const box = panel("usage", "Usage of this session", [list, el("h4", {}, "Due"), due, none]);
  let parts = [];
  return {
    node: box.node,
    update({ usage: counters, components }) {
      if (rows.length !== counters.length) {
        rows = counters.map(row);
        list.replaceChildren(...rows.map(({ node }) => node));
      }
      rows.forEach(({ node, number }, i) => {
        node.hidden = counters[i].value == null;
        say(number, counted(counters[i]));
      });
      none.hidden = components.length > 0;
      if (parts.length !== components.length) {
        parts = components.map(() => {
          const level = badge(),
            name = el("b"),
            text = el("span", { class: "reason" });
          return { level, name, text, node: el("li", {}, name, level.node, text) };
        });
        due.replaceChildren(...parts.map((part) => part.node));
      }
      components.forEach((component, i) => {
        const { level, name, text } = parts[i],
          used = component.used_percent;
        say(name, `${component.kind}${component.number ? ` ${component.number}` : ""}${component.name ? ` ${component.name}` : ""}`);
        // What it ran before is not known on every link: then it may be due without our knowing.
        const partial = !component.life && component.status === "green" && used != null;
        const [known, word] = DUE[component.status];
        level.set(partial ? "stale" : known, partial ? "life unknown" : word);
        const since = component.life ? "" : " in this session",
          part = used == null ? "no limit" : `${fixed(used, 0)} % used of ${component.limit}`;
        say(text, `${part}, ${fixed(component.flight_h, 2)} h, ${whole(component.flights)} flights${since}`);
      });
    },
  };
};

export const link = () => {
  const pairs = (names) => {
    const numbers = names.map(([id]) => el("b", { "data-value": id }));
    return [
      numbers,
      el(
        "dl",
        { class: "facts" },
        names.map(([, label], i) => el("div", { class: "fact" }, el("dt", {}, label), el("dd", {}, numbers[i]))),
      ),
    ];
  };
  const [numbers, list] = pairs([
    ["link:rate", "Frames"],
    ["link:loss", "Lost, last 10 s"],
    ["link:missing", "Missing in all"],
    ["link:heard", "Autopilot heard"],
    ["link:reboots", "Restarts of the autopilot"],
  ]);
  const recorder = badge(),
    told = el("span", { class: "reason" });
  const [points, database] = pairs([
    ["influx:written", "Points written"],
    ["influx:waiting", "Waiting"],
  ]);
  const trouble = el("p", { class: "small" });
  const written = el("div", { hidden: true }, el("h4", {}, "Database"), database, trouble);
  const box = panel("link", "Recorder and link", [
    el("p", { class: "recorder" }, el("b", {}, "Recorder"), recorder.node, told),
    list,
    written,
  ]);
  return {
    node: box.node,
    update(state, head) {
      const { link: figures, companion } = state;
      if (!companion && head.source.log_end) {
        recorder.set("ok", "recorded this");
        say(told, head.source.log_end);
      } else if (!companion) {
        recorder.set("stale", "not heard");
        say(told, head.source.recording ? "no HUMS is heard in this recording" : "no HUMS speaks on this link");
      } else if (companion.gone) {
        recorder.set("stale", "gone");
        say(told, `last heard ${age(companion.heard_ms)} ago`);
      } else {
        recorder.set(
          companion.recorder ?? "stale",
          companion.recorder == null ? "not told" : companion.recorder === "ok" ? "recording" : companion.recorder,
        );
        const counted = [
          companion.flight_s == null ? "" : `${span(companion.flight_s)} in the air`,
          companion.flights == null ? "" : companion.flights === 1 ? "1 flight" : `${whole(companion.flights)} flights`,
        ].filter(Boolean);
        say(told, counted.length ? `on board: ${counted.join(", ")}` : "");
      }
      say(numbers[0], `${fixed(head.frames_s, 0)} /s, ${whole(figures.frames)} of this vehicle`);
      say(numbers[1], figures.loss_percent == null ? "not known yet" : `${fixed(figures.loss_percent, 1)} %`);
      say(numbers[2], whole(figures.missing));
      say(numbers[3], state.heard_ms < 1500 ? "now" : `${age(state.heard_ms)} ago`);
      say(numbers[4], whole(figures.reboots));
      written.hidden = !head.influx;
      if (head.influx) {
        say(points[0], whole(head.influx.written));
        say(points[1], whole(head.influx.waiting));
        const lost = head.influx.lost + head.influx.rejected;
        say(trouble, [lost ? `${whole(lost)} points lost or refused.` : "", head.influx.trouble].filter(Boolean).join(" "));
        toggle(trouble, "critical", lost > 0);
      }
    },
  };
};
