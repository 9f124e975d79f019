// One plot: lines over time with their limits; phases, gaps and findings behind them; one cursor for all.

import { axis } from "./canvas.js";
import { PHASES, colour, isDark, line, printing, whenColoursChange } from "./colours.js";
import { attribute, panel, say } from "./dom.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { clock, fixed, grouped } from "./text.js";
import { home, look, moveCursor, view, whenCursorMoves, whenViewChanges } from "./view.js";

const EVERY_MS = 100,
  HEIGHT = 176;
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000, 86400, 604800];
// Nobody counts nine and a half satellites.
const WHOLE_STEPS = [0, 1, 2, 3, 4, 5, 6, 7, 8].flatMap((power) => [1, 2, 5].map((digit) => digit * 10 ** power));
const sync = uPlot.sync("time");
export const charts = [];

// Room above and below; a line that hardly moves is not blown up to a storm; a limit that is near is seen.
const range = (low, high, { limits, decimals } = {}) => {
  if (low == null || high == null || (low === 0 && high === 0)) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high), 1e-3),
    span = Math.max(high - low, size * 0.05, decimals === 0 ? 1 : 0);
  for (const limit of (limits ?? []).flat()) {
    if (limit == null) continue;
    if (limit < low && limit > low - span) low = limit;
    if (limit > high && limit < high + span) high = limit;
  }
  const room = Math.max((high - low) * 0.08, size * 0.01);
  return [low >= 0 && low < high - low ? 0 : low - room, high + room];
};
const times = (_u, splits) => {
  const fine = splits.length > 1 && splits[1] - splits[0] < 1;
  return splits.map((s) => (fine ? fixed(s - flight.zero, 1) : clock(Math.round(s - flight.zero))));
};
const dashed = (ctx, name, dash, points) => {
  ctx.strokeStyle = colour(name);
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
  ctx.beginPath();
  ctx.moveTo(...points[0]);
  ctx.lineTo(...points[1]);
  ctx.stroke();
};
// A limit that moves is a line of its plot.
const isLimit = (text) => text.startsWith("Limit");
const inColour = (number, text) => (isLimit(text) ? colour("warning") : line(number));
// Behind the lines.
const ground = (u, limits) => {
  const { ctx, bbox } = u,
    right = bbox.left + bbox.width,
    bottom = bbox.top + bbox.height;
  const x = (at) => u.valToPos(at, "x", true);
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  flight.phases.forEach(([from, phase], i) => {
    const to = flight.phases[i + 1]?.[0] ?? flight.end;
    if (phase === "ground" || to < view.from || from > view.to) return;
    ctx.fillStyle = PHASES[phase] + (isDark() ? "24" : "16");
    ctx.fillRect(x(from), bbox.top, x(to) - x(from), bbox.height);
  });
  ctx.fillStyle = colour("gap");
  for (const [from, to] of flight.gaps) ctx.fillRect(x(from), bbox.top, Math.max(x(to) - x(from), 2), bbox.height);
  ctx.globalAlpha = 0.75;
  for (const { kind, level, at_s } of flight.notes) {
    if (kind !== "finding" || level === "ok" || at_s < view.from || at_s > view.to) continue;
    dashed(
      ctx,
      level,
      [4, 3],
      [
        [x(at_s), bbox.top],
        [x(at_s), bottom],
      ],
    );
  }
  ctx.globalAlpha = 1;
  for (const pair of limits ?? []) {
    for (const [i, limit] of pair.entries()) {
      if (limit == null) continue;
      const y = u.valToPos(limit, "y", true);
      dashed(
        ctx,
        i ? "critical" : "warning",
        [7, 3],
        [
          [bbox.left, y],
          [right, y],
        ],
      );
    }
  }
  ctx.restore();
};

export const chart = (id, name = null) => {
  const keys = el("div", { class: "keys" }),
    body = el("div", { class: "plotted", role: "img" }),
    unit = el("small");
  const box = panel(id, name ?? "", [keys, body], { class: "plot" });
  const title = box.node.querySelector(".name");
  title.after(unit);
  box.node.id = `plot-${id}`;
  let made = null,
    key = "",
    labels = [],
    drawn = "",
    drawnAt = 0,
    told = null,
    seen = true;
  const info = () => flight.plots.get(id);
  const values = () =>
    labels.forEach(({ number, value }, i) => {
      const v = view.cursor != null ? flight.value(id, number, view.cursor) : told ? told[number]?.[0] : flight.value(id, number);
      say(value, v == null ? "" : fixed(v, info()?.decimals ?? 1));
      attribute(labels[i].node, "class", labels[i].shown ? "" : "off");
    });
  // What the picture shows, for a reader who does not see it.
  const describe = ([, ...columns]) => {
    const { unit, decimals } = info();
    const lines = labels.map(({ text }, i) => {
      const known = columns[i].filter((v) => v != null);
      return known.length ? `${text} ${fixed(Math.min(...known), decimals)} to ${fixed(Math.max(...known), decimals)}` : `${text} no data`;
    });
    const [from, to] = [view.from, view.to].map((at) => clock(Math.round(at - flight.zero)));
    attribute(body, "aria-label", `${title.textContent}, ${unit}, from ${from} to ${to}: ${lines.join("; ")}`);
  };
  const label = ([number, text]) => {
    const mark = el("i"),
      value = el("b", { "data-value": `${id}:${number}` });
    const node = el("button", { type: "button", title: "show or hide" }, mark, text, value);
    const one = { number, text, node, value, shown: labels.find((known) => known.number === number)?.shown ?? true };
    mark.style.borderColor = inColour(number, text);
    node.addEventListener("click", () => self.show(number, !one.shown));
    return one;
  };
  const build = () => {
    const plot = info();
    made?.destroy();
    say(title, name ?? plot.title);
    say(unit, plot.unit);
    attribute(box.node, "aria-label", `${plot.title}, ${plot.unit}`);
    labels = flight.lines(id).map(label);
    keys.replaceChildren(...labels.map(({ node }) => node));
    made = new uPlot(
      {
        width: Math.max(body.clientWidth, 200),
        height: HEIGHT,
        // Half of the last time stands beyond the edge.
        padding: [8, 18, 0, 0],
        cursor: { y: false, sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false, setScale: false }, points: { size: 6 } },
        legend: { show: false },
        scales: { x: { time: false, auto: false }, y: { range: (_u, low, high) => range(low, high, info()) } },
        axes: [
          axis({ values: times, space: 54, size: 28, incrs: STEPS }),
          axis({
            size: 54,
            space: 28,
            ...(plot.decimals === 0 ? { incrs: WHOLE_STEPS } : {}),
            values: (_u, splits) => splits.map((v) => grouped(String(Number(v.toPrecision(6)))).replace("-", "\u2212")),
          }),
        ],
        series: [
          {},
          ...labels.map(({ number, text, shown }) => ({
            stroke: inColour(number, text),
            dash: isLimit(text) ? [7, 3] : undefined,
            width: 1.5,
            points: { show: false },
            spanGaps: false,
            show: shown,
            paths: plot.unit === "count" ? uPlot.paths.stepped({ align: 1 }) : undefined,
          })),
        ],
        hooks: {
          drawClear: [(u) => ground(u, info()?.limits)],
          setSelect: [
            (u) => {
              if (u.select.width < 4) return;
              const [from, to] = [u.select.left, u.select.left + u.select.width].map((left) => u.posToVal(left, "x"));
              u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
              look(from, to);
            },
          ],
          ready: [
            (u) => {
              u.over.addEventListener("dblclick", home);
              u.over.addEventListener("mousemove", (event) =>
                moveCursor(u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x")),
              );
              u.over.addEventListener("mouseleave", () => moveCursor(null));
            },
          ],
        },
      },
      [[], ...labels.map(() => [])],
      body,
    );
  };
  const self = {
    id,
    node: box.node,
    // Values as they are now, by line, where more is known of them than the series tell.
    tell(now) {
      told = now;
      box.fresh(...now.filter(Boolean));
    },
    draw() {
      const plot = info(),
        now = plot ? JSON.stringify([plot, flight.lines(id)]) : "";
      if (!plot || !flight.lines(id).length) return;
      if (now !== key) {
        key = now;
        build();
      }
      drawn = `${flight.version} ${view.from} ${view.to}`;
      drawnAt = performance.now();
      const table = flight.table(
        id,
        labels.map(({ number }) => number),
        view.from,
        view.to,
      );
      describe(table);
      made.batch(() => {
        made.setData(table, false);
        made.setScale("x", { min: view.from, max: view.to });
      });
      values();
    },
    // Shows or hides the line of a number.
    show(number, on) {
      const place = labels.findIndex((known) => known.number === number);
      if (place < 0) return;
      labels[place].shown = on;
      made.setSeries(place + 1, { show: on });
      values();
    },
    // In other colours.
    again() {
      key = "";
      self.draw();
    },
    // Draws what is new, where somebody sees it, not too often.
    update(now = false) {
      // Its lines have names and values also where nobody sees it.
      if (flight.lines(id).length !== labels.length) self.draw();
      else if (seen && (now || performance.now() - drawnAt >= EVERY_MS) && drawn !== `${flight.version} ${view.from} ${view.to}`)
        self.draw();
      else if (told) values();
    },
    point() {
      if (!made) return;
      values();
      if (!made.over.matches(":hover"))
        made.setCursor({ left: view.cursor == null ? -10 : made.valToPos(view.cursor, "x"), top: 20 }, false, false);
    },
  };
  new IntersectionObserver((entries) => {
    seen = entries.some((entry) => entry.isIntersecting);
    if (seen) self.update(true);
  }).observe(box.node);
  new ResizeObserver(() => made?.setSize({ width: Math.max(body.clientWidth, 200), height: HEIGHT })).observe(body);
  charts.push(self);
  return self;
};
whenViewChanges(() => {
  for (const one of charts) one.update(true);
});
whenCursorMoves(() => {
  for (const one of charts) one.point();
});
whenColoursChange(() => {
  for (const one of charts) one.again();
});
// On paper everything is seen.
addEventListener("beforeprint", () => printing(true));
addEventListener("afterprint", () => printing(false));
