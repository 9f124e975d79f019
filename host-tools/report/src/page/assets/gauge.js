// A round gauge.

import { say, attribute, toggle, panel } from "./dom.js";
import { svg } from "./elements.js";
import { fixed } from "./text.js";

const FROM = -120,
  TO = 120,
  RADIUS = 46,
  CENTRE = [60, 58];
const point = (degrees, radius) => {
  const angle = ((degrees - 90) * Math.PI) / 180;
  return [CENTRE[0] + radius * Math.cos(angle), CENTRE[1] + radius * Math.sin(angle)];
};
const arc = (from, to, radius) => {
  const [x0, y0] = point(from, radius),
    [x1, y1] = point(to, radius);
  const large = Math.abs(to - from) > 180 ? 1 : 0,
    clockwise = to > from ? 1 : 0;
  return `M${x0.toFixed(2)} ${y0.toFixed(2)}A${radius} ${radius} 0 ${large} ${clockwise} ${x1.toFixed(2)} ${y1.toFixed(2)}`;
};

// Gauges that are compared have one `scale`, which grows with the highest value of any. `limits` are [warning, critical]; below them
// is bad where the second is the lower one.
export const gauge = (
  id,
  title,
  { unit = "", low = 0, high, decimals = 0, class: own = "", scale: shared = { top: high, grows: false } } = {},
) => {
  const value = svg("path", { class: "value" }),
    number = svg("text", { class: "number", x: 60, y: 63, "data-value": id });
  const needle = svg("path", { class: "needle", d: "M60 16.5L57.6 24h4.8z" });
  const bands = svg("g", { class: "bands" });
  const ends = [svg("text", { class: "end", x: 20, y: 94 }), svg("text", { class: "end", x: 100, y: 94 })];
  const picture = svg(
    "svg",
    { class: "gauge", viewBox: "0 0 120 98", role: "img" },
    svg("path", { class: "track", d: arc(FROM, TO, RADIUS) }),
    bands,
    value,
    needle,
    number,
    svg("text", { class: "unit", x: 60, y: 78 }, unit),
    ends,
  );
  const box = panel(id, title, picture, { class: `instrument ${own}` });
  let top = shared.top,
    drawn = null;
  const at = (v) => FROM + ((Math.min(Math.max(v, low), top) - low) / (top - low)) * (TO - FROM);
  const scale = (limits) => {
    const key = `${top} ${limits}`;
    if (key === drawn) return;
    drawn = key;
    say(ends[0], fixed(low, 0));
    say(ends[1], fixed(top, 0));
    bands.replaceChildren();
    if (!limits) return;
    const [warning, critical] = limits;
    const spans =
      critical < warning
        ? [
            ["critical", low, critical],
            ["warning", critical, warning],
          ]
        : [
            ["warning", warning, critical],
            ["critical", critical, top],
          ];
    for (const [level, from, to] of spans) {
      const known = Number.isFinite(from) && Number.isFinite(to) && at(to) > at(from);
      if (known) bands.append(svg("path", { class: level, d: arc(at(from), at(to), RADIUS + 6) }));
    }
  };
  const level = (v, limits) => {
    if (!limits || v == null) return "";
    const [warning, critical] = limits;
    const bad = (limit) => (critical < warning ? v < limit : v > limit);
    return bad(critical) ? "critical" : bad(warning) ? "warning" : "";
  };
  return {
    node: box.node,
    update(shown, limits) {
      const v = shown?.[0];
      // Round steps, so that the scale seldom moves.
      if (shared.grows && v > shared.top) {
        const digit = 10 ** Math.floor(Math.log10(v));
        shared.top = Math.ceil((v * 1.05) / digit) * digit;
      }
      top = shared.top;
      scale(limits);
      box.fresh(shown);
      say(number, fixed(v, decimals));
      const angle = at(v ?? low),
        zero = at(Math.max(low, Math.min(0, top)));
      attribute(value, "d", v == null || Math.abs(angle - zero) < 1.2 ? "" : arc(zero, angle, RADIUS));
      attribute(needle, "transform", `rotate(${angle.toFixed(1)} ${CENTRE[0]} ${CENTRE[1]})`);
      toggle(needle, "away", v == null);
      const now = level(v, limits);
      toggle(box.node, "is-warning", now === "warning");
      toggle(box.node, "is-critical", now === "critical");
      attribute(picture, "aria-label", `${title} ${fixed(v, decimals)} ${unit}${now ? `, ${now}` : ""}`);
    },
  };
};
