// The heading: the rose turns, the vehicle looks up.

import { say, attribute, panel } from "./dom.js";
import { svg } from "./elements.js";
import { fixed } from "./text.js";

const QUARTERS = ["N", "E", "S", "W"];

export const compass = () => {
  const ticks = [];
  for (let degrees = 0; degrees < 360; degrees += 10) {
    ticks.push(svg("path", { d: `M0 -50v${degrees % 30 === 0 ? 7 : 4}`, transform: `rotate(${degrees})` }));
  }
  const names = QUARTERS.map((name, i) =>
    svg("text", { class: name === "N" ? "north" : "", y: -33, transform: `rotate(${90 * i})` }, name),
  );
  const rose = svg("g", {}, svg("circle", { class: "ring", r: 50 }), ticks, names);
  const number = svg("text", { class: "number", y: 7, "data-value": "heading" });
  const picture = svg(
    "svg",
    { class: "gauge compass", viewBox: "-60 -60 120 120", role: "img" },
    rose,
    svg("path", { class: "pointer", d: "M0 -43l-5.5 -13h11z" }),
    number,
    svg("text", { class: "unit", y: 20 }, "\u00b0"),
  );
  const box = panel("heading", "Heading", picture, { class: "instrument" });
  let turned = 0;
  return {
    node: box.node,
    update({ values }) {
      const shown = values.heading ?? values.yaw;
      const heading = shown?.[0] == null ? null : (shown[0] + 360) % 360;
      box.fresh(shown);
      say(number, fixed(heading, 0));
      // The short way round.
      turned += ((((-(heading ?? 0) - turned) % 360) + 540) % 360) - 180;
      attribute(rose, "transform", `rotate(${turned.toFixed(1)})`);
      attribute(picture, "aria-label", `Heading ${fixed(heading, 0)} degrees`);
    },
  };
};
