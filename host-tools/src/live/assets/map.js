// The track over ground, to scale and without tiles: no network is needed for it.

import { say, panel } from "./dom.js";
import { el } from "./elements.js";
import { fixed } from "./shown.js";
import { colour, whenColoursChange } from "./colours.js";

const EVERY_MS = 100;
const METRES = 111320;
const STEPS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000];
// Nobody flies in a window smaller than this: noise is not blown up.
const SPAN_MIN_M = 20;

export const map = () => {
  const canvas = el("canvas", { class: "map", role: "img", "aria-label": "Track over ground, north is up" });
  const body = el("div", { class: "mapped" }, canvas);
  const far = el("b"), way = el("span", {}, "from the start ", far, " m");
  const box = panel("map", "Track", [body, el("p", { class: "pair" }, way, el("span", { class: "dim" }, "north is up"))], { class: "wide" });
  let drawn = "", drawnAt = 0;
  whenColoursChange(() => { drawn = ""; });
  const draw = (track, place, heading) => {
    const width = body.clientWidth || 300, height = body.clientHeight || 220, ratio = devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    if (!track.length) return;
    const [, lat0, lon0] = track[0], shrink = Math.cos(lat0 * Math.PI / 180);
    const metres = (lat, lon) => [(lon - lon0) * METRES * shrink, (lat - lat0) * METRES];
    const points = track.map(([, lat, lon]) => metres(lat, lon));
    if (place) points.push(metres(place[0], place[1]));
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const [x, y] of points) { left = Math.min(left, x); right = Math.max(right, x); low = Math.min(low, y); high = Math.max(high, y); }
    const scale = Math.min((width - 40) / Math.max(right - left, SPAN_MIN_M), (height - 44) / Math.max(high - low, SPAN_MIN_M));
    const x = (m) => width / 2 + (m - (left + right) / 2) * scale, y = (m) => height / 2 - 4 - (m - (low + high) / 2) * scale;
    ctx.strokeStyle = colour("grid");
    ctx.lineWidth = 1;
    const step = STEPS.find((s) => s * scale >= 48) ?? STEPS[STEPS.length - 1];
    ctx.beginPath();
    for (let m = Math.ceil(((left + right) / 2 - width / 2 / scale) / step) * step; x(m) < width; m += step) { ctx.moveTo(x(m), 0); ctx.lineTo(x(m), height); }
    for (let m = Math.ceil(((low + high) / 2 - height / 2 / scale) / step) * step; y(m) > 0; m += step) { ctx.moveTo(0, y(m)); ctx.lineTo(width, y(m)); }
    ctx.stroke();
    ctx.strokeStyle = colour("accent");
    ctx.lineWidth = 2;
    ctx.lineJoin = "round";
    ctx.beginPath();
    points.forEach(([px, py], i) => i ? ctx.lineTo(x(px), y(py)) : ctx.moveTo(x(px), y(py)));
    ctx.stroke();
    ctx.fillStyle = colour("panel");
    ctx.strokeStyle = colour("dim");
    ctx.beginPath();
    ctx.arc(x(0), y(0), 4, 0, 7);
    ctx.fill();
    ctx.stroke();
    const [px, py] = points[points.length - 1];
    ctx.save();
    ctx.translate(x(px), y(py));
    ctx.rotate((heading ?? 0) * Math.PI / 180);
    ctx.fillStyle = colour("ink");
    ctx.strokeStyle = colour("panel");
    ctx.lineWidth = 2;
    ctx.beginPath();
    if (heading == null) ctx.arc(0, 0, 5, 0, 7);
    else { ctx.moveTo(0, -11); ctx.lineTo(7, 8); ctx.lineTo(0, 4); ctx.lineTo(-7, 8); ctx.closePath(); }
    ctx.fill();
    ctx.stroke();
    ctx.restore();
    const wide = step * scale;
    ctx.fillStyle = colour("dim");
    ctx.fillRect(12, height - 12, wide, 2);
    ctx.fillRect(12, height - 16, 1.5, 6);
    ctx.fillRect(12 + wide - 1.5, height - 16, 1.5, 6);
    ctx.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    ctx.fillText(step >= 1000 ? `${step / 1000} km` : `${step} m`, 16, height - 18);
    say(far, fixed(Math.hypot(px, py), 0));
  };
  return {
    node: box.node,
    update({ values }, history) {
      const { latitude, longitude } = values, heading = (values.heading ?? values.yaw)?.[0];
      box.fresh(latitude);
      const time = performance.now(), key = `${history.version} ${latitude?.[0]} ${longitude?.[0]} ${heading} ${body.clientWidth}`;
      if (time - drawnAt < EVERY_MS || key === drawn) return;
      drawn = key;
      drawnAt = time;
      draw(history.track, latitude?.[0] == null ? null : [latitude[0], longitude[0]], heading);
    },
  };
};
