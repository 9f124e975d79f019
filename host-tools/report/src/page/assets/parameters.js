// The autopilot's parameters: those that changed, those that are not at their default, those that are others than in the last flight; and
// all, by name.

import { el } from "./elements.js";
import { flight } from "./flight.js";
import { cells, rows } from "./layout.js";
import { moment, plural, short } from "./text.js";

const course = (values) =>
  values.map(([at, value], i) => (i ? `${short(value)} at ${moment(at - flight.zero)}` : short(value))).join(" \u2192 ");
const last = ({ values }) => values[values.length - 1][1];
// A parameter is of single precision on the wire.
const same = (one, other) => Math.fround(one) === Math.fround(other);
// One without a default is at it, where a log tells defaults.
const isOther = ({ values, usual }) => usual != null && !same(values[values.length - 1][1], usual);
const table = (parameters) =>
  rows(
    [["Parameter"], ["Value"], ...(flight.tellsDefaults ? [["Default"]] : [])],
    parameters.map(([name, one]) =>
      cells([name, course(one.values), ...(flight.tellsDefaults ? [one.usual == null ? "" : short(one.usual)] : [])], ["t", "words", "t"], {
        class: one.values.length > 1 ? "changed" : "",
      }),
    ),
  );

const NO_DEFAULTS =
  "This recording does not tell which parameters are at their defaults. ArduPilot's own log (.bin) does since 4.3, and PX4's ULog since 1.12.";

// What the autopilot counts, measures or stores itself is nothing that somebody changed.
const OWN = /^(STAT_|BARO\d*_GND_PRESS|SYS_NUM_RESETS|COM_FLIGHT_UUID|LND_FLIGHT_T_|_HASH_CHECK)/;
// What is other than in the flight before at the end of both, where that is known: names with their values then.
const compared = ({ name, values }) => {
  const before = new Map(values);
  const other = [...flight.parameters].filter(([key, one]) => before.has(key) && !same(before.get(key), last(one)) && !OWN.test(key));
  const gone = values.filter(([key]) => !flight.parameters.has(key)).length;
  const added = [...flight.parameters].filter(([key]) => !before.has(key)).length;
  const rest = [
    added ? `${plural(added, "parameter")} of this recording ${added === 1 ? "is" : "are"} not in that one.` : "",
    gone ? `${plural(gone, "parameter")} of that one ${gone === 1 ? "is" : "are"} not in this recording.` : "",
    "What the autopilot itself counts or measures (STAT_, ground pressure) is left out.",
  ];
  return [
    other.length
      ? rows(
          [["Parameter"], [`In ${name}`], ["Here"]],
          other.map(([key, one]) =>
            cells([key, short(before.get(key)), course(one.values)], ["t", "words", "words"], { class: "changed" }),
          ),
          { id: "parameters-before" },
        )
      : el("p", { class: "dim", id: "parameters-before" }, `All that both tell are as in ${name}.`),
    el("p", { class: "dim" }, rest.filter(Boolean).join(" ")),
  ];
};

// `before` is the flight before of the same vehicle: its name, and its parameters as they were at its end.
export const parameters = (before = null) => {
  const changed = el("div"),
    notUsual = el("div", { id: "parameters-other" }),
    earlier = el("div"),
    all = el("div", { class: "scroll tall" }),
    count = el("summary");
  const wanted = el("input", { type: "search", placeholder: "name", "aria-label": "Parameters whose name has this in it" });
  const list = el("details", {}, count, wanted, all);
  const none = el("p", { class: "dim" }, "No parameter was told. A link tells them when a ground station asks for them.");
  const some = el("div", {}, changed, notUsual, earlier, list);
  let drawn = "";
  const fill = () => {
    const part = wanted.value.toUpperCase();
    if (list.open) all.replaceChildren(table([...flight.parameters].filter(([name]) => name.toUpperCase().includes(part))));
  };
  const group = (node, title, parameters, empty) =>
    node.replaceChildren(el("h4", {}, title), parameters.length ? table(parameters) : el("p", { class: "dim" }, empty));
  wanted.addEventListener("input", fill);
  list.addEventListener("toggle", fill);
  return {
    node: el("div", { class: "panel scroll" }, none, some),
    update() {
      const known = [...flight.parameters],
        moved = known.filter(([, { values }]) => values.length > 1),
        other = known.filter(([, one]) => isOther(one)),
        key = `${known.length} ${JSON.stringify(moved)} ${other.map(([name, one]) => name + last(one))}`;
      if (key === drawn) return;
      drawn = key;
      none.hidden = known.length > 0;
      some.hidden = !none.hidden;
      group(changed, "Changed while this was recorded", moved, "None changed.");
      group(notUsual, "Not at their default", other, flight.tellsDefaults ? "All are at their default." : NO_DEFAULTS);
      if (before) earlier.replaceChildren(el("h4", {}, "Changed since the last flight"), ...compared(before));
      const left = flight.parametersLeftOut ? `; ${plural(flight.parametersLeftOut, "value")} of others not kept` : "";
      count.textContent = `All ${plural(known.length, "parameter")}${left}`;
      fill();
    },
  };
};
