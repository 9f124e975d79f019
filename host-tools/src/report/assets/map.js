// The track, drawn to scale on the tangent plane.

import { canvas } from "./canvas.js";
import { data, findings, grid } from "./data.js";
import { el } from "./elements.js";
import { PHASES, css, fixed } from "./format.js";
import { view, whenCursorMoves, whenViewChanges } from "./view.js";

const track = data.track;
const map = el("canvas", { class: "map", id: "map", role: "img", "aria-label": "Track over ground" });
const heights = track.map((p) => p.height_m).filter((h) => h != null);
const heightRange = heights.length ? heights.reduce(([a, b], h) => [Math.min(a, h), Math.max(b, h)], [Infinity, -Infinity]) : null;
// Viridis, from five of its colours.
const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const shade = (part) => {
  const at = Math.min(Math.max(part, 0), 1) * (VIRIDIS.length - 1), i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return `rgb(${VIRIDIS[i].map((c, k) => Math.round(c + (VIRIDIS[i + 1][k] - c) * (at - i))).join(",")})`;
};
const METRES = 111320;
export const places = (() => {
  if (!track.length) return null;
  const middle = track[track.length >> 1];
  const scale = Math.cos(middle.latitude * Math.PI / 180);
  return track.map((p) => [(p.longitude - middle.longitude) * METRES * scale, (p.latitude - middle.latitude) * METRES]);
})();
const round = (metres) => {
  const power = 10 ** Math.floor(Math.log10(metres));
  return [5, 2, 1].map((n) => n * power).find((n) => n <= metres) ?? power;
};
let mapQueued = false;
export const drawMap = () => {
  if (!places || mapQueued) return;
  mapQueued = true;
  requestAnimationFrame(() => { mapQueued = false; paintMap(); });
};
export const paintMap = () => {
  const [ctx, width, height] = canvas(map, Math.min(460, Math.max(260, map.clientWidth * 0.62)));
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [e, n] of places) {
    west = Math.min(west, e); east = Math.max(east, e); south = Math.min(south, n); north = Math.max(north, n);
  }
  const margin = 34;
  const scale = Math.min((width - 2 * margin) / Math.max(east - west, 2), (height - 2 * margin) / Math.max(north - south, 2));
  const x = (e) => width / 2 + (e - (west + east) / 2) * scale;
  const y = (n) => height / 2 - (n - (south + north) / 2) * scale;
  ctx.fillStyle = css("--soft");
  ctx.fillRect(0, 0, width, height);
  // Squares of a round size, for a feeling of distance.
  const square = round(90 / scale);
  ctx.strokeStyle = css("--rule");
  ctx.lineWidth = 1;
  for (let e = Math.floor((-width / 2 / scale + (west + east) / 2) / square) * square; x(e) < width; e += square) {
    ctx.beginPath(); ctx.moveTo(x(e), 0); ctx.lineTo(x(e), height); ctx.stroke();
  }
  for (let n = Math.floor((-height / 2 / scale + (south + north) / 2) / square) * square; y(n) > 0; n += square) {
    ctx.beginPath(); ctx.moveTo(0, y(n)); ctx.lineTo(width, y(n)); ctx.stroke();
  }
  ctx.lineCap = ctx.lineJoin = "round";
  const usual = 5;
  for (let i = 1; i < places.length; i++) {
    const silent = track[i].at_s - track[i - 1].at_s > Math.max(usual, 4 * grid.interval_s * 2);
    const inside = track[i].at_s >= view.from && track[i - 1].at_s <= view.to;
    ctx.globalAlpha = inside ? 1 : .25;
    ctx.lineWidth = inside ? 2.5 : 1.5;
    ctx.setLineDash(silent ? [3, 5] : []);
    const part = heightRange && track[i].height_m != null ? (track[i].height_m - heightRange[0]) / Math.max(heightRange[1] - heightRange[0], 1) : 0.4;
    ctx.strokeStyle = shade(part);
    ctx.beginPath();
    ctx.moveTo(x(places[i - 1][0]), y(places[i - 1][1]));
    ctx.lineTo(x(places[i][0]), y(places[i][1]));
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
  ctx.setLineDash([]);
  const near = (at) => {
    let low = 0, high = track.length - 1;
    while (low < high) { const mid = (low + high) >> 1; if (track[mid].at_s < at) low = mid + 1; else high = mid; }
    return low;
  };
  const spot = (i, colour, size) => {
    ctx.beginPath();
    ctx.arc(x(places[i][0]), y(places[i][1]), size, 0, 7);
    ctx.fillStyle = colour;
    ctx.fill();
    ctx.lineWidth = 2;
    ctx.strokeStyle = css("--panel");
    ctx.stroke();
  };
  const label = (i, text, up) => {
    const wide = ctx.measureText(text).width;
    const left = Math.min(Math.max(x(places[i][0]) + 8, 4), width - wide - 6), top = Math.min(Math.max(y(places[i][1]) + (up ? -8 : 18), 14), height - 6);
    ctx.lineWidth = 3;
    ctx.strokeStyle = css("--soft");
    ctx.strokeText(text, left, top);
    ctx.fillStyle = css("--ink");
    ctx.fillText(text, left, top);
  };
  for (const f of findings) if (f.level !== "ok") spot(near(f.time_s), css("--" + f.level), 5);
  data.flights.slice(0, 9).forEach((f, i) => {
    const number = data.flights.length > 1 ? ` ${i + 1}` : "";
    spot(near(f.from_s), PHASES.take_off, 5);
    label(near(f.from_s), "take-off" + number, true);
    if (f.landed) { spot(near(f.to_s), PHASES.landing, 5); label(near(f.to_s), "landing" + number, false); }
  });
  if (view.cursor != null) spot(near(view.cursor), css("--accent"), 7);
  ctx.fillStyle = css("--ink");
  ctx.strokeStyle = css("--ink");
  const bar = square * scale;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(14, height - 20); ctx.lineTo(14, height - 14); ctx.lineTo(14 + bar, height - 14); ctx.lineTo(14 + bar, height - 20);
  ctx.stroke();
  ctx.fillText(square >= 1000 ? square / 1000 + " km" : square + " m", 20, height - 20);
  ctx.beginPath();
  ctx.moveTo(width - 20, 12); ctx.lineTo(width - 26, 30); ctx.lineTo(width - 20, 26); ctx.lineTo(width - 14, 30);
  ctx.fill();
  ctx.fillText("N", width - 24, 44);
};
whenViewChanges(drawMap);
whenCursorMoves(drawMap);

export const trackMap = (host) => {
  if (places) {
    const scaleBar = heightRange ? el("span", {}, `height ${fixed(heightRange[0], 0)} m`, (() => {
      const i = el("i");
      i.style.cssText = `width:90px;background:linear-gradient(90deg, ${[0, .25, .5, .75, 1].map(shade).join(",")})`;
      return i;
    })(), `${fixed(heightRange[1], 0)} m`) : null;
    const middle = track[0];
    host.append(el("div", { class: "panel", style: "margin-top:12px" }, map, el("div", { class: "legend" }, scaleBar,
      el("span", {}, `begins at ${middle.latitude.toFixed(7)}\u00b0, ${middle.longitude.toFixed(7)}\u00b0`),
      el("span", { class: "noprint" }, "the blue spot follows the cursor of the plots"))));
  } else {
    host.append(el("p", { class: "dim" }, "The vehicle never knew where it was: there is no track."));
  }
};
