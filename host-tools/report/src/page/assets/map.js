// The track over ground, to scale. Its colour is the height. Tiles lie under it only if the user named a server of them.

import { FONT, canvas } from "./canvas.js";
import { PHASES, colour, whenColoursChange } from "./colours.js";
import { attribute } from "./dom.js";
import { el } from "./elements.js";
import { flight, place } from "./flight.js";
import { fixed } from "./text.js";
import { drawTiles, tilesFrom } from "./tiles.js";
import { view, whenCursorMoves, whenViewChanges } from "./view.js";

const EVERY_MS = 100,
  METRES = 111320,
  MARGIN = 34;
// Nobody flies in a window smaller than this: noise is not blown up.
const SPAN_MIN_M = 20;
// Viridis, from five of its colours.
const VIRIDIS = [
  [68, 1, 84],
  [59, 82, 139],
  [33, 145, 140],
  [94, 201, 98],
  [253, 231, 37],
];
const shade = (part) => {
  const at = Math.min(Math.max(part, 0), 1) * (VIRIDIS.length - 1),
    i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return `rgb(${VIRIDIS[i].map((c, k) => Math.round(c + (VIRIDIS[i + 1][k] - c) * (at - i))).join(",")})`;
};
const bounds = (row) =>
  row.reduce(([low, high], v) => (v == null ? [low, high] : [Math.min(low, v), Math.max(high, v)]), [Infinity, -Infinity]);

// As a search engine and a map take it.
const degrees = ([, north, east]) => `${north.toFixed(7)}, ${east.toFixed(7)}`;
// The place that is so many metres east and north of one.
const beyond = ([, lat0, lon0], e, n) => [
  lon0 + e / (METRES * Math.cos((lat0 * Math.PI) / 180)),
  Math.min(Math.max(lat0 + n / METRES, -85), 85),
];
// Places as metres east and north of one.
const around = ([, lat0, lon0]) => {
  const shrink = Math.cos((lat0 * Math.PI) / 180);
  // The short way round the earth: a track may cross the 180th meridian.
  const east = (degrees) => degrees - 360 * Math.round(degrees / 360);
  return ([, lat, lon]) => [east(lon - lon0) * METRES * shrink, (lat - lat0) * METRES];
};
const edges = (points) => [bounds(points.map(([e]) => e)), bounds(points.map(([, n]) => n))];
// How wide and how tall a track is, how far it leads from its beginning, and between which heights: metres.
export const extent = (track) => {
  const points = track.map(around(track[0]));
  const [[west, east], [south, north]] = edges(points);
  return {
    wide: east - west,
    tall: north - south,
    far: points.reduce((far, point) => Math.max(far, Math.hypot(...point)), 0),
    heights: bounds(track.map((p) => p[3])),
  };
};

// Of the flight, or of another one (`whose`); `frame` gives the size and the heights that maps side by side have in common.
export const map = ({ id = "map", whose = flight, frame = null, name = "Track over ground, north is up" } = {}) => {
  const surface = el("canvas", { class: "map", id, role: "img", "aria-label": name });
  const node = el("div", { class: "mapped" }, surface);
  const legend = el("p", { class: "legend" });
  let drawn = "",
    drawnAt = 0,
    here = null;
  const again = () => self.update(here, true);
  const paint = () => {
    const width = node.clientWidth || 300,
      height = node.clientHeight || 220,
      { track } = whose;
    const ctx = canvas(surface, width, height);
    if (!track.length) return;
    const metres = around(track[0]);
    const points = track.map(metres);
    if (here) points.push(metres([0, ...here.place]));
    const [[west, east], [south, north]] = edges(points),
      { wide, tall, heights } = frame?.() ?? { wide: east - west, tall: north - south, heights: bounds(track.map((p) => p[3])) },
      [low, high] = heights;
    const scale = Math.min((width - 2 * MARGIN) / Math.max(wide, SPAN_MIN_M), (height - 2 * MARGIN) / Math.max(tall, SPAN_MIN_M));
    const x = (e) => width / 2 + (e - (west + east) / 2) * scale,
      y = (n) => height / 2 - (n - (south + north) / 2) * scale;
    const corner = (px, py) =>
      beyond(track[0], (west + east) / 2 + (px - width / 2) / scale, (south + north) / 2 - (py - height / 2) / scale);
    const [left, top] = corner(0, 0),
      [right, bottom] = corner(width, height);
    drawTiles(
      ctx,
      { west: left, east: right, south: bottom, north: top },
      scale,
      (lon, lat) => {
        const [e, n] = metres([0, lat, lon]);
        return [x(e), y(n)];
      },
      again,
    );
    // Squares of a round size, for a feeling of distance.
    const power = 10 ** Math.floor(Math.log10(90 / scale)),
      square = [5, 2, 1].map((n) => n * power).find((n) => n <= 90 / scale) ?? power;
    ctx.strokeStyle = colour("rule");
    ctx.lineWidth = 1;
    ctx.beginPath();
    const first = (middle, size) => Math.ceil((middle - size / 2 / scale) / square) * square;
    for (let e = first((west + east) / 2, width); x(e) < width; e += square) {
      ctx.moveTo(x(e), 0);
      ctx.lineTo(x(e), height);
    }
    for (let n = first((south + north) / 2, height); y(n) > 0; n += square) {
      ctx.moveTo(0, y(n));
      ctx.lineTo(width, y(n));
    }
    ctx.stroke();
    ctx.lineCap = ctx.lineJoin = "round";
    for (let i = 1; i < track.length; i++) {
      const [from, to] = [track[i - 1][0], track[i][0]],
        silent = to - from > Math.max(5, 8 * whose.step);
      const inside = !view.away || (to >= view.from && from <= view.to);
      ctx.globalAlpha = inside ? 1 : 0.25;
      ctx.lineWidth = inside ? 2.5 : 1.5;
      ctx.setLineDash(silent ? [3, 5] : []);
      ctx.strokeStyle = shade(track[i][3] == null ? 0.4 : (track[i][3] - low) / Math.max(high - low, 1));
      ctx.beginPath();
      ctx.moveTo(x(points[i - 1][0]), y(points[i - 1][1]));
      ctx.lineTo(x(points[i][0]), y(points[i][1]));
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
    ctx.setLineDash([]);
    const near = (at) =>
      points[
        Math.min(
          place(track, at, ([time]) => time),
          track.length - 1,
        )
      ];
    const spot = ([e, n], paint, size) => {
      ctx.beginPath();
      ctx.arc(x(e), y(n), size, 0, 7);
      ctx.fillStyle = paint;
      ctx.fill();
      ctx.lineWidth = 2;
      ctx.strokeStyle = colour("panel");
      ctx.stroke();
    };
    const label = ([e, n], text, up) => {
      const wide = ctx.measureText(text).width;
      const left = Math.min(Math.max(x(e) + 8, 4), width - wide - 6),
        top = Math.min(Math.max(y(n) + (up ? -8 : 18), 14), height - 6);
      ctx.lineWidth = 3;
      ctx.strokeStyle = colour("soft");
      ctx.strokeText(text, left, top);
      ctx.fillStyle = colour("ink");
      ctx.fillText(text, left, top);
    };
    for (const { kind, level, at_s } of whose.notes) if (kind === "finding" && level !== "ok") spot(near(at_s), colour(level), 5);
    whose.flights.slice(0, 9).forEach((f, i) => {
      const number = whose.flights.length > 1 ? ` ${i + 1}` : "";
      spot(near(f.from_s), PHASES.take_off, 5);
      label(near(f.from_s), `${f.took_off === false ? "first heard, in the air" : "take-off"}${number}`, true);
      if (f.landed) {
        spot(near(f.to_s), PHASES.landing, 5);
        label(near(f.to_s), `landing${number}`, false);
      }
    });
    // Where whoever looks for it begins.
    if (whose.endsInAir) {
      const last = points[track.length - 1];
      spot(last, colour("critical"), 7);
      label(last, "last heard, in the air", false);
    }
    if (view.cursor != null) spot(near(view.cursor), colour("accent"), 7);
    if (here) {
      const [e, n] = points[points.length - 1];
      ctx.save();
      ctx.translate(x(e), y(n));
      ctx.rotate(((here.heading ?? 0) * Math.PI) / 180);
      ctx.fillStyle = colour("ink");
      ctx.strokeStyle = colour("panel");
      ctx.lineWidth = 2;
      ctx.beginPath();
      if (here.heading == null) ctx.arc(0, 0, 5, 0, 7);
      else {
        ctx.moveTo(0, -11);
        ctx.lineTo(7, 8);
        ctx.lineTo(0, 4);
        ctx.lineTo(-7, 8);
        ctx.closePath();
      }
      ctx.fill();
      ctx.stroke();
      ctx.restore();
    }
    surface.dataset.scale = scale;
    const bar = square * scale;
    ctx.strokeStyle = ctx.fillStyle = colour("dim");
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(14, height - 18);
    ctx.lineTo(14, height - 12);
    ctx.lineTo(14 + bar, height - 12);
    ctx.lineTo(14 + bar, height - 18);
    ctx.stroke();
    ctx.font = FONT;
    ctx.fillText(square >= 1000 ? `${square / 1000} km` : `${square} m`, 20, height - 18);
    const away = metres([0, ...(here?.place ?? track[track.length - 1].slice(1, 3))]);
    legend.replaceChildren(
      el("span", {}, "from the start", el("b", {}, `${fixed(Math.hypot(...away), 0)} m`)),
      Number.isFinite(low) ? el("span", {}, `height ${fixed(low, 0)} to ${fixed(high, 0)} m, from blue to yellow`) : "",
      el("span", {}, `begins at ${degrees(track[0])}`),
      el(
        "span",
        {},
        whose.endsInAir
          ? el("b", {}, `ends in the air at ${degrees(track[track.length - 1])}`)
          : `ends at ${degrees(track[track.length - 1])}`,
      ),
      el("span", { class: "dim" }, "north is up"),
      tilesFrom ? el("span", { class: "dim" }, `map tiles from ${tilesFrom}`) : "",
    );
    const words = [...legend.children].map((part) => [...part.childNodes].map((node) => node.textContent).join(" "));
    attribute(surface, "aria-label", `${name}: ${words.join("; ")}`);
  };
  const self = {
    node,
    legend,
    // Where the vehicle is now, where that is known: degrees.
    update(vehicle = null, now = false) {
      const time = performance.now(),
        key = [whose.version, JSON.stringify(vehicle), view.cursor, view.from, view.away, node.clientWidth].join();
      if (!now && (time - drawnAt < EVERY_MS || key === drawn)) return;
      [drawn, drawnAt, here] = [key, time, vehicle];
      paint();
    },
  };
  whenViewChanges(again);
  whenCursorMoves(again);
  whenColoursChange(again);
  new ResizeObserver(again).observe(node);
  return self;
};
