// The horizon: the ground turns and moves behind a fixed vehicle, as it looks from inside.

import { say, attribute, panel } from "./dom.js";
import { el, svg } from "./elements.js";
import { fixed } from "./text.js";

// Pixels a degree of pitch.
const DEGREE = 2.2;

export const horizon = () => {
  const ladder = [];
  for (let degrees = -60; degrees <= 60; degrees += 10) {
    if (degrees === 0) continue;
    const y = -degrees * DEGREE,
      half = degrees % 20 === 0 ? 22 : 12;
    ladder.push(svg("path", { d: `M${-half} ${y}h${2 * half}` }));
    if (degrees % 20 === 0) ladder.push(svg("text", { x: half + 5, y: y + 3.4 }, String(Math.abs(degrees))));
  }
  const world = svg(
    "g",
    {},
    svg("rect", { class: "sky", x: -900, y: -1200, width: 1800, height: 1200 }),
    svg("rect", { class: "ground", x: -900, y: 0, width: 1800, height: 1200 }),
    svg("path", { class: "line", d: "M-900 0h1800" }),
    svg("g", { class: "ladder" }, ladder),
  );
  const marks = [-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60].map((degrees) =>
    svg("path", { d: `M0 -80v${degrees % 30 === 0 ? 9 : 5}`, transform: `rotate(${degrees})` }),
  );
  const pointer = svg("path", { class: "pointer", d: "M0 -70l-5 -9h10z" });
  const picture = svg(
    "svg",
    { class: "horizon", viewBox: "-110 -90 220 180", role: "img" },
    world,
    svg("g", { class: "marks" }, marks),
    pointer,
    svg("path", { class: "vehicle", d: "M-62 0h38l8 9M62 0h-38l-8 9" }),
    svg("circle", { class: "vehicle", r: 2.4 }),
  );
  const numbers = ["roll", "pitch"].map((id) => el("b", { "data-value": id }));
  const box = panel(
    "horizon",
    "Attitude",
    [picture, el("p", { class: "pair" }, el("span", {}, "Roll ", numbers[0], "\u00b0"), el("span", {}, "Pitch ", numbers[1], "\u00b0"))],
    { class: "wide" },
  );
  return {
    node: box.node,
    update({ values }) {
      const { roll, pitch } = values;
      box.fresh(roll, pitch);
      const turn = -(roll?.[0] ?? 0),
        shift = (pitch?.[0] ?? 0) * DEGREE;
      attribute(world, "transform", `rotate(${turn.toFixed(2)}) translate(0 ${shift.toFixed(2)})`);
      attribute(pointer, "transform", `rotate(${turn.toFixed(2)})`);
      say(numbers[0], fixed(roll?.[0], 1));
      say(numbers[1], fixed(pitch?.[0], 1));
      attribute(picture, "aria-label", `Roll ${fixed(roll?.[0], 0)} degrees, pitch ${fixed(pitch?.[0], 0)} degrees`);
    },
  };
};
