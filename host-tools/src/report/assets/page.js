"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const log = data.log;
  const root = document.documentElement;

  // ---- Small helpers. All text goes onto the page as text, never as markup.
  const el = (name, attributes = {}, ...children) => {
    const node = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key === "class") node.className = value;
      else if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
      else if (value !== false && value != null) node.setAttribute(key, value === true ? "" : value);
    }
    for (const child of children.flat()) if (child != null) node.append(child);
    return node;
  };
  const svg = (name, attributes = {}) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };
  const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const group = (text) => text.replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");
  const whole = (value) => group(String(Math.round(value)));
  const fixed = (value, decimals) => {
    const [before, after] = Number(value).toFixed(decimals).replace(/^-(?=[0.]*$)/, "").split(".");
    return group(before) + (after ? "." + after : "");
  };
  const span = (seconds) => {
    const s = Math.round(seconds);
    const two = (n) => String(n).padStart(2, "0");
    return s >= 3600 ? `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}` : `${Math.floor(s / 60)}:${two(s % 60)}`;
  };
  const bytes = (n) => n >= 1e6 ? fixed(n / 1e6, 1) + " MB" : n >= 1e3 ? fixed(n / 1e3, 1) + " kB" : n + " B";
  const plural = (n, one, many) => `${whole(n)} ${n === 1 ? one : many || one + "s"}`;
  const utc = (seconds) => data.epoch_us == null ? null : new Date(data.epoch_us / 1000 + seconds * 1000);
  const clock = (seconds) => utc(seconds)?.toISOString().slice(11, 19) ?? null;
  const words = (name) => name.replace(/_/g, " ");

  const LEVELS = ["ok", "advisory", "stale", "warning", "critical"];
  const PHASES = {
    "ground": "#8a949e", "take_off": "#d9822b", "hover": "#3f8fd2", "climb": "#4fae62", "cruise": "#7a68c9",
    "descent": "#d0a215", "landing": "#c65b7c",
  };
  const phaseName = (phase) => phase.replace("_", "-");
  // Paul Tol's bright and muted schemes: told apart by colour-blind eyes, on light and on dark ground.
  const LINES = [
    ["#2f6fb7", "#5aa2f0"], ["#d1495b", "#ff7a8a"], ["#1f8a4c", "#4cc27c"], ["#b8860b", "#e5b93c"],
    ["#2a9fb5", "#5fd0e6"], ["#a03a8a", "#dd78c6"], ["#6b7680", "#aab4be"], ["#8a5a2b", "#c99a68"],
    ["#4b4fae", "#9296f5"], ["#5f8f1f", "#a4d25a"], ["#c2571a", "#ff9a5c"], ["#177a76", "#4fc9c2"],
    ["#7f3f3f", "#d49a9a"], ["#3f6f7f", "#8fc3d4"],
  ];
  const dark = () => !root.classList.contains("printing") && matchMedia("(prefers-color-scheme: dark)").matches;
  const line = (index) => LINES[index % LINES.length][dark() ? 1 : 0];

  // ---- Time.
  const start = log.start_s ?? 0;
  const end = Math.max(log.end_s ?? 0, start + 1);
  const gaps = log.gaps.map((gap) => [gap.from_s ?? start, gap.to_s ?? end, gap]);
  const findings = log.findings;

  // ---- Series: intervals with a lowest and a highest value, as two points each.
  const grid = data.grid;
  const expand = (series) => {
    const points = new Map();
    let at = 0;
    series.steps.forEach((step, i) => {
      at += step;
      points.set(at, [series.values[2 * i], series.values[2 * i + 1]]);
    });
    return points;
  };
  const table = (plot) => {
    const lines = plot.series.map(expand);
    const used = [...new Set(lines.flatMap((points) => [...points.keys()]))].sort((a, b) => a - b);
    const x = used.flatMap((i) => [grid.start_s + (i + 0.25) * grid.interval_s, grid.start_s + (i + 0.75) * grid.interval_s]);
    const columns = lines.map((points) => {
      const own = [...points.keys()];
      const steps = own.slice(1).map((v, i) => v - own[i]).sort((a, b) => a - b);
      const usual = steps.length ? steps[steps.length >> 1] : 1;
      const silence = Math.max(5 / grid.interval_s, 6 * usual);
      const column = [];
      let last = null;
      for (const i of used) {
        const pair = points.get(i);
        if (!pair) { column.push(undefined, undefined); continue; }
        if (last != null && i - last > silence && column.length) {
          // The line breaks where nothing was heard: null in the last place that has no value.
          for (let k = column.length - 1; k >= 0 && column[k] === undefined; k--) column[k] = null;
        }
        column.push(pair[0], pair[1]);
        last = i;
      }
      return column;
    });
    return [x, ...columns];
  };

  // ---- Header.
  const vehicle = log.vehicle;
  const name = vehicle
    ? `${vehicle.autopilot}${vehicle.firmware ? " " + vehicle.firmware : ""} ${vehicle.type}`
    : "Vehicle unknown";
  const rank = (level) => LEVELS.indexOf(level);
  const worst = findings.reduce((worst, f) => rank(f.level) > rank(worst) ? f.level : worst, "ok");
  const count = (level) => findings.filter((f) => f.level === level).length;
  const verdict = worst === "ok" ? "No findings"
    : ["critical", "warning", "stale", "advisory"].filter(count).map((level) => `${count(level)} ${level}`).join(", ");
  const head = document.getElementById("head");
  const when = log.start_utc ? `${log.start_utc.slice(0, 10)} ${log.start_utc.slice(11, 19)} UTC` : "time of day unknown";
  document.title = `${name}, session ${log.name}, ${when}`;
  head.append(
    el("h1", {}, name),
    el("p", { class: "dim" }, `Session ${log.name} \u00b7 ${when} \u00b7 ${span(log.duration_s)} \u00b7 ${log.closed ? "ended in order" : "ended by power-off"}`),
    el("p", { class: `verdict ${worst}`, id: "verdict" }, verdict),
  );

  // ---- Sections.
  const main = document.getElementById("main");
  const bar = el("div");
  document.getElementById("nav").append(bar);
  const section = (id, title) => {
    bar.append(el("a", { href: "#" + id }, title));
    const node = el("section", { id }, el("h2", {}, title));
    main.append(node);
    return node;
  };
  const rows = (headings, body, options = {}) => el("table", options,
    el("thead", {}, el("tr", {}, headings.map(([text, kind]) => el("th", { class: kind || "", scope: "col" }, text)))),
    el("tbody", {}, body));
  const cells = (values, kinds, attributes = {}) => el("tr", attributes, values.map((value, i) => el("td", { class: kinds[i] || "" }, value)));
  const facts = (pairs) => el("dl", {}, pairs.filter(([, value]) => value != null && value !== "").flatMap(([key, value]) => [el("dt", {}, key), el("dd", {}, value)]));

  // Summary.
  const usage = log.usage;
  const tile = (value, unit, label) => value == null ? null : el("div", { class: "tile" }, el("b", {}, value, unit ? el("span", {}, unit) : null), el("small", {}, label));
  const tiles = () => {
    const flown = data.flights.reduce((sum, f) => sum + f.to_s - f.from_s, 0);
    const peak = (id) => {
      const plot = data.plots.find((p) => p.id === id);
      return plot ? plot.series[0].values.reduce((a, b) => Math.max(a, b), -Infinity) : null;
    };
    const low = (id) => {
      const plot = data.plots.find((p) => p.id === id);
      return plot ? plot.series[0].values.reduce((a, b) => Math.min(a, b), Infinity) : null;
    };
    const of = (value, decimals) => value == null || !Number.isFinite(value) ? null : fixed(value, decimals);
    const battery = data.flights.length ? data.flights[data.flights.length - 1] : null;
    return el("div", { class: "tiles" },
      tile(span(flown), "", plural(data.flights.length, "flight")),
      tile(of(usage.distance_m, 0), "m", "over ground in the air"),
      tile(of(usage.height_max_m ?? peak("Height"), 1), "m", "greatest height"),
      tile(of(usage.speed_max_m_s ?? peak("Speed"), 1), "m/s", "greatest ground speed"),
      tile(of(low("PackVolts"), 2), "V", "lowest battery voltage"),
      tile(of(peak("PackAmperes"), 1), "A", "highest battery current"),
      battery && battery.percent_to != null && data.flights[0].percent_from != null
        ? tile(`${of(data.flights[0].percent_from, 0)} \u2192 ${of(battery.percent_to, 0)}`, "%", "battery in flight") : null,
      tile(of(usage.vibration_max_m_s2, 1), "m/s\u00b2", "highest vibration"),
      tile(whole(log.frames), "", "frames recorded"),
      tile(fixed(log.ratio, 1), "\u00d7", "smaller than a tlog"));
  };
  const summary = section("summary", "Summary");
  summary.append(tiles());
  const identity = facts([
    ["Vehicle", name],
    ["System", vehicle && `${vehicle.system}, component ${vehicle.component}`],
    ["Autopilot's id", vehicle?.uid],
    ["From", log.start_utc ?? `${fixed(start, 3)} s after power-on`],
    ["To", log.end_utc ?? `${fixed(end, 3)} s after power-on`],
    ["Monitor", log.monitor && `${log.monitor.version} ${log.monitor.git} on ${log.monitor.board}, started by ${log.monitor.reset}, start ${log.monitor.boots}`],
    ["Session id", log.session],
    ["Files", log.files.join(", ")],
  ]);
  const flights = data.flights.length ? rows(
    [["#", "n"], ["Take-off"], ["Landing"], ["Time", "n"], ["Height", "n"], ["Speed", "n"], ["Battery", "n"]],
    data.flights.map((f, i) => cells([
      i + 1, clock(f.from_s) ?? span(f.from_s - start), f.landed ? clock(f.to_s) ?? span(f.to_s - start) : "in the air at the end", span(f.to_s - f.from_s),
      fixed(f.height_max_m, 1) + " m", fixed(f.speed_max_m_s, 1) + " m/s",
      f.percent_from != null && f.percent_to != null ? `${fixed(f.percent_from, 0)} \u2192 ${fixed(f.percent_to, 0)} %` : "",
    ], ["n", "t", "t", "n", "n", "n", "n"], { class: "go", tabindex: 0, onclick: () => zoom(f.from_s, f.to_s), onkeydown: (e) => e.key === "Enter" && zoom(f.from_s, f.to_s) })))
    : el("p", { class: "dim" }, "The vehicle was not in the air.");
  summary.append(el("div", { class: "split" },
    el("div", { class: "panel scroll" }, identity), el("div", { class: "panel scroll", id: "flights" }, flights)));

  // Findings.
  const value = (f) => f.value == null ? "" : `${Number(f.value.toPrecision(5))} ${f.unit}`;
  const limit = (f) => f.limit == null ? "" : `${Number(f.limit.toPrecision(5))} ${f.unit}`;
  const found = section("findings", "Findings");
  found.append(findings.length ? el("div", { class: "panel scroll tall" }, rows(
    [["Time", "n"], ["UTC"], ["Level"], ["Check"], ["Was"], ["Value", "n"], ["Limit", "n"]],
    findings.map((f) => cells([
      fixed(f.time_s - start, 1) + " s", clock(f.time_s) ?? "", el("span", { class: `badge ${f.level}` }, f.level),
      `${f.subsystem}: ${words(f.check)}${f.instance ? " " + (f.instance + 1) : ""}`, f.previous, value(f), limit(f),
    ], ["n", "t", "t", "", "t", "n", "n"], {
      class: "go finding", tabindex: 0, onclick: () => look(f.time_s), onkeydown: (e) => e.key === "Enter" && look(f.time_s),
    }))), log.findings_count > findings.length ? el("p", { class: "dim" }, `and ${whole(log.findings_count - findings.length)} more`) : null)
    : el("p", { class: "dim" }, "Every check stayed within its limits, or had nothing to look at."));

  // ---- Plots.
  const charts = [];
  let range = [start, end];
  const setRange = (from, to) => {
    range = [from, to];
    back.hidden = from <= start && to >= end;
    for (const chart of charts) chart.plot.setScale("x", { min: from, max: to });
    drawStrip();
    drawMap();
  };
  const zoom = (from, to) => {
    const margin = Math.max((to - from) * 0.03, 1);
    setRange(Math.max(start, from - margin), Math.min(end, to + margin));
    document.getElementById("time").scrollIntoView({ behavior: "smooth" });
  };
  const look = (at) => {
    const half = Math.max(15, (end - start) / 20);
    zoom(at - half, at + half);
    setTimeout(() => point(at), 50);
  };
  const back = el("button", { type: "button", hidden: true, onclick: () => setRange(start, end) }, "whole session");

  const axis = (extra) => ({
    stroke: css("--dim"), font: "12px system-ui, 'DejaVu Sans', sans-serif",
    grid: { stroke: css("--grid"), width: 1 }, ticks: { stroke: css("--grid"), width: 1, size: 4 }, ...extra,
  });
  const times = (u, splits) => {
    const fine = splits.length > 1 && splits[1] - splits[0] < 1;
    return splits.map((s) => fine ? fixed(s - start, 1) : span(s - start));
  };
  const marks = (u) => {
    const { ctx, bbox } = u;
    const x = (at) => u.valToPos(at, "x", true);
    const left = bbox.left, right = bbox.left + bbox.width;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const phase of data.phases) {
      if (phase.phase === "ground") continue;
      ctx.fillStyle = PHASES[phase.phase] + (dark() ? "1c" : "14");
      ctx.fillRect(x(phase.from_s), bbox.top, x(phase.to_s) - x(phase.from_s), bbox.height);
    }
    ctx.fillStyle = css("--gap");
    for (const [from, to] of gaps) ctx.fillRect(x(from), bbox.top, Math.max(x(to) - x(from), 2), bbox.height);
    for (const f of findings) {
      const at = x(f.time_s);
      if (at < left || at > right || f.level === "ok") continue;
      ctx.strokeStyle = css("--" + f.level);
      ctx.globalAlpha = .75;
      ctx.lineWidth = devicePixelRatio;
      ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
      ctx.beginPath();
      ctx.moveTo(at, bbox.top);
      ctx.lineTo(at, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  };
  const sync = uPlot.sync("time");
  const chart = (plot, host) => {
    const columns = table(plot);
    const keys = plot.series.map((series, i) => {
      const key = el("button", { type: "button", title: "show or hide" }, el("i"), series.label, el("b"));
      key.addEventListener("click", () => {
        const shown = !made.plot.series[i + 1].show;
        key.classList.toggle("off", !shown);
        made.plot.setSeries(i + 1, { show: shown });
      });
      return key;
    });
    const body = el("div");
    const box = el("div", { class: "panel plot", id: "plot-" + plot.id },
      el("h3", {}, plot.title, plot.unit ? el("small", { class: "dim" }, plot.unit) : null),
      el("div", { class: "keys" }, keys), body);
    host.append(box);
    const made = { plot: null, info: plot };
    const show = (u) => {
      const i = u.cursor.idx;
      plot.series.forEach((series, s) => {
        let at = i;
        // The nearest value before, where this series is slower than others of its plot.
        while (at != null && at > 0 && u.data[s + 1][at] == null && i - at < 400) at--;
        const v = at == null ? null : u.data[s + 1][at];
        keys[s].lastChild.textContent = v == null ? "" : fixed(v, plot.decimals);
      });
      if (i != null) mapTime = u.data[0][i];
      else mapTime = null;
      drawMap();
    };
    made.draw = () => {
      made.plot?.destroy();
      body.replaceChildren();
      plot.series.forEach((series, s) => { keys[s].firstChild.style.borderColor = line(series.line); });
      made.plot = new uPlot({
        width: Math.max(body.clientWidth, 240), height: innerWidth < 760 ? 170 : 190, padding: [8, 8, 0, 0],
        cursor: { sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false, setScale: false }, points: { size: 6 } },
        legend: { show: false },
        scales: { x: { time: false, min: range[0], max: range[1], range: (u, min, max) => [min ?? range[0], max ?? range[1]] }, y: { range: limits } },
        axes: [
          axis({ values: times, space: 70, size: 28, incrs: [.1, .2, .5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000, 86400, 604800] }),
          axis({ size: 58, values: (u, splits) => splits.map((v) => group(String(Number(v.toPrecision(6))))) }),
        ],
        series: [{}, ...plot.series.map((series, s) => ({
          label: series.label, stroke: line(series.line), width: 1.4, points: { show: false }, spanGaps: false,
          show: !keys[s].classList.contains("off"),
          paths: plot.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
        }))],
        hooks: {
          drawClear: [marks],
          setCursor: [show],
          setSelect: [(u) => {
            if (u.select.width < 4) return;
            const from = u.posToVal(u.select.left, "x"), to = u.posToVal(u.select.left + u.select.width, "x");
            u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
            setRange(from, to);
          }],
          ready: [(u) => u.over.addEventListener("dblclick", () => setRange(start, end))],
        },
      }, columns, body);
    };
    made.resize = () => made.plot?.setSize({ width: Math.max(body.clientWidth, 240), height: made.plot.height });
    charts.push(made);
    return made;
  };
  // Room above and below; a line that hardly moves is not blown up to a storm.
  const limits = (u, low, high) => {
    if (low == null || high == null) return [0, 1];
    if (low === 0 && high === 0) return [0, 1];
    const size = Math.max(Math.abs(low), Math.abs(high), 1e-3);
    const room = Math.max((high - low) * 0.08, size * 0.01);
    return [low >= 0 && low < (high - low) ? 0 : low - room, high + room];
  };
  const point = (at) => {
    for (const { plot } of charts) {
      const left = plot.valToPos(at, "x");
      plot.setCursor({ left, top: plot.cursor.top < 0 ? 20 : plot.cursor.top }, false);
    }
    mapTime = at;
    drawMap();
  };

  // Time: phases, findings and gaps on one strip, and the way there and back.
  const time = section("time", "Timeline and track");
  const strip = el("canvas", { class: "map", id: "timeline", role: "img", "aria-label": "Phases, findings and gaps over time" });
  const canvas = (node, height) => {
    const width = node.clientWidth || 600, ratio = devicePixelRatio || 1;
    node.width = Math.round(width * ratio);
    node.height = Math.round(height * ratio);
    node.style.height = height + "px";
    const ctx = node.getContext("2d");
    ctx.scale(ratio, ratio);
    ctx.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    return [ctx, width, height];
  };
  const stripX = (at, width) => (at - range[0]) / (range[1] - range[0]) * width;
  const drawStrip = () => {
    const [ctx, width] = canvas(strip, 74);
    const x = (at) => stripX(at, width);
    ctx.fillStyle = css("--soft");
    ctx.fillRect(0, 26, width, 22);
    for (const phase of data.phases) {
      const left = x(phase.from_s), wide = x(phase.to_s) - left;
      ctx.fillStyle = PHASES[phase.phase];
      ctx.fillRect(left, 26, Math.max(wide, 1), 22);
      const label = ctx.measureText(phaseName(phase.phase)).width;
      if (wide > label + 10) {
        ctx.fillStyle = "#fff";
        ctx.fillText(phaseName(phase.phase), left + (wide - label) / 2, 41);
      }
    }
    ctx.fillStyle = css("--ink");
    for (const [from, to] of gaps) {
      const left = x(from), wide = Math.max(x(to) - left, 2);
      ctx.fillStyle = css("--paper");
      ctx.fillRect(left, 26, wide, 22);
      ctx.strokeStyle = css("--critical");
      ctx.strokeRect(left + .5, 26.5, wide - 1, 21);
    }
    for (const f of findings) {
      const at = x(f.time_s);
      ctx.fillStyle = css("--" + f.level);
      ctx.beginPath();
      ctx.moveTo(at, 25);
      ctx.lineTo(at - 5, 12);
      ctx.lineTo(at + 5, 12);
      ctx.fill();
    }
    ctx.fillStyle = css("--dim");
    const steps = [.1, .2, .5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 36000, 86400];
    const step = steps.find((s) => (range[1] - range[0]) / s <= width / 90) ?? 604800;
    for (let at = start + Math.ceil((range[0] - start) / step) * step; at <= range[1]; at += step) {
      const text = step < 1 ? fixed(at - start, 1) : span(at - start);
      const wide = ctx.measureText(text).width;
      ctx.fillRect(x(at), 48, 1, 4);
      ctx.fillText(text, Math.min(Math.max(x(at) - wide / 2, 0), width - wide), 65);
    }
  };
  strip.addEventListener("click", (event) => {
    const rect = strip.getBoundingClientRect();
    point(range[0] + (event.clientX - rect.left) / rect.width * (range[1] - range[0]));
  });
  const shownPhases = [...new Set(data.phases.map((p) => p.phase))];
  const dot = (colour) => { const i = el("i"); i.style.background = colour; return i; };
  time.append(el("div", { class: "panel strip" }, strip, el("div", { class: "legend" },
    shownPhases.map((phase) => el("span", {}, dot(PHASES[phase]), phaseName(phase))),
    gaps.length ? el("span", {}, "framed in red: a gap in the record") : null,
    el("span", { class: "noprint" }, "Drag over a plot to look closer; double click for the whole session."))));

  // The track, drawn to scale on the tangent plane.
  const track = data.track;
  let mapTime = null;
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
  const places = (() => {
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
  const drawMap = () => {
    if (!places || mapQueued) return;
    mapQueued = true;
    requestAnimationFrame(() => { mapQueued = false; paintMap(); });
  };
  const paintMap = () => {
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
      const inside = track[i].at_s >= range[0] && track[i - 1].at_s <= range[1];
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
    if (mapTime != null) spot(near(mapTime), css("--accent"), 7);
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
  if (places) {
    const scaleBar = heightRange ? el("span", {}, `height ${fixed(heightRange[0], 0)} m`, (() => {
      const i = el("i");
      i.style.cssText = `width:90px;background:linear-gradient(90deg, ${[0, .25, .5, .75, 1].map(shade).join(",")})`;
      return i;
    })(), `${fixed(heightRange[1], 0)} m`) : null;
    const middle = track[0];
    time.append(el("div", { class: "panel", style: "margin-top:12px" }, map, el("div", { class: "legend" }, scaleBar,
      el("span", {}, `begins at ${middle.latitude.toFixed(7)}\u00b0, ${middle.longitude.toFixed(7)}\u00b0`),
      el("span", { class: "noprint" }, "the blue spot follows the cursor of the plots"))));
  } else {
    time.append(el("p", { class: "dim" }, "The vehicle never knew where it was: there is no track."));
  }

  // The plots by group; the first of each is as wide as the page, pairs follow.
  const groups = [...new Set(data.plots.map((p) => p.group))];
  for (const title of groups) {
    const host = section(title.toLowerCase(), title);
    const of = data.plots.filter((p) => p.group === title);
    const box = el("div", { class: of.length > 1 ? "plots two" : "plots" });
    host.append(box);
    // Drawn when all are there: how wide each is depends on how many there are.
    for (const made of of.map((plot) => chart(plot, box))) made.draw();
  }

  // Usage, and what is due.
  const UNITS = [["_m_s2", "m/s\u00b2", 2], ["_m_s", "m/s", 2], ["_percent", "%", 1], ["_ohm", "\u03a9", 4], ["_g", "g", 2], ["_s", "s", 0], ["_m", "m", 0], ["_ah", "Ah", 3], ["_wh", "Wh", 2], ["_a", "A", 2], ["_v", "V", 2]];
  const counter = (key, v) => {
    const cycles = /^load_cycles_from_(\d+(?:_\d+)?)_g$/.exec(key);
    if (cycles) return [`Load cycles of ${cycles[1].replace("_", ".")} g and more`, whole(v)];
    const unit = UNITS.find(([ending]) => key.endsWith(ending));
    if (!unit) return [words(key), Number.isInteger(v) ? whole(v) : fixed(v, 2)];
    const title = words(key.slice(0, -unit[0].length));
    return [title, unit[1] === "s" ? `${span(v)} (${whole(v)} s)` : `${fixed(v, unit[2])} ${unit[1]}`];
  };
  const wear = section("usage", "Usage and what is due");
  const COMPONENT = { green: "ok", yellow: "warning", red: "critical" };
  const meter = (percent, status) => {
    const inner = el("i"), outer = el("span", { class: "meter" }, inner);
    inner.style.width = `${Math.min(Math.max(percent, 0), 100)}%`;
    inner.style.background = css("--" + (COMPONENT[status] ?? "stale"));
    return outer;
  };
  if (log.components.length) {
    wear.append(el("div", { class: "panel scroll", id: "components" }, rows(
      [["Part"], ["Serial number"], ["Used"], ["State"], ["In the air", "n"], ["Turning", "n"], ["Flights", "n"], ["Cycles", "n"]],
      [...log.components].sort((x, y) => (y.used_percent ?? -1) - (x.used_percent ?? -1)).map((c) => cells([
        `${words(c.kind)}${c.number ? " " + c.number : ""}${c.name ? " \u00b7 " + c.name : ""}`, c.serial,
        c.used_percent == null ? "no limit" : el("span", { class: "used" }, meter(c.used_percent, c.status), `${fixed(c.used_percent, 1)} %`),
        el("span", { class: `badge ${COMPONENT[c.status] ?? "stale"}` }, c.used_percent >= 100 ? "due" : c.status),
        `${fixed(c.flight_s / 3600, 2)} h`, `${fixed(c.motor_s / 3600, 2)} h`, whole(c.flights), fixed(c.cycles, 2),
      ], ["", "t", "", "t", "n", "n", "n", "n"])))));
  }
  const exceeded = log.exceedances.filter((e) => e.session.warnings || e.session.criticals || e.lifetime.warnings || e.lifetime.criticals);
  if (exceeded.length) {
    const times = (count, seconds) => count ? `${whole(count)} \u00d7, ${fixed(seconds, 1)} s` : "";
    const peak = (e, of) => e[of].peak == null ? "" : `${Number(e[of].peak.toPrecision(4))} ${e.unit}`;
    wear.append(el("h3", { class: "above" }, "Limits exceeded"), el("div", { class: "panel scroll" }, rows(
      [["Check"], ["Warning", "n"], ["Critical", "n"], ["Peak", "n"], ["Warning, in its life", "n"], ["Critical, in its life", "n"], ["Peak, in its life", "n"]],
      exceeded.map((e) => cells([`${words(e.check)}${e.instance ? " " + (e.instance + 1) : ""}`,
        times(e.session.warnings, e.session.warning_s), times(e.session.criticals, e.session.critical_s), peak(e, "session"),
        times(e.lifetime.warnings, e.lifetime.warning_s), times(e.lifetime.criticals, e.lifetime.critical_s), peak(e, "lifetime")],
      ["", "n", "n", "n", "n", "n", "n"])))));
  }
  const names = Object.keys(usage);
  if (names.length) {
    const life = log.lifetime;
    const lived = Object.keys(life).length > 0;
    const motors = {}, plain = [], bands = {};
    for (const key of names) {
      const motor = /^motor(\d+)_(run_time_s|revolutions)$/.exec(key);
      const band = /^(.*?)_(?:below_([\d_]+)|from_([\d_]+)|(-?[\d_]+)_to_([\d_]+))_([a-z].*)_s$/.exec(key);
      if (motor) (motors[motor[1]] ??= {})[motor[2]] = key;
      else if (band) (bands[band[1]] ??= []).push([band, usage[key]]);
      else plain.push(cells([...counter(key, usage[key]), life[key] == null ? "" : counter(key, life[key])[1]], ["", "n", "n"]));
    }
    const heading = ["This session", "n"], ever = ["In its life", "n"];
    const numbers = Object.keys(motors).map(Number).sort((x, y) => x - y);
    const ofMotor = (from, m, name) => {
      const v = from[motors[m][name]];
      return v == null ? "" : name === "revolutions" ? whole(v) : span(v);
    };
    const motorTable = rows([["Motor"], ["Run time", "n"], ["Revolutions", "n"], ...(lived ? [["Run time, in its life", "n"], ["Revolutions, in its life", "n"]] : [])],
      numbers.map((m) => cells([m + 1, ofMotor(usage, m, "run_time_s"), ofMotor(usage, m, "revolutions"),
        ...(lived ? [ofMotor(life, m, "run_time_s"), ofMotor(life, m, "revolutions")] : [])], ["", "n", "n", "n", "n"])));
    const number = (text) => Number(text.replace("_", "."));
    const histograms = Object.entries(bands).map(([name, list]) => {
      const sum = list.reduce((all, [, v]) => all + v, 0);
      if (sum === 0) return null;
      const edge = (band) => band[2] != null ? -Infinity : number(band[3] ?? band[4]);
      const unit = { m_s2: "m/s\u00b2", m_s: "m/s", degc: "\u00b0C", percent: "%", a: "A", v: "V", g: "g", rpm: "rpm" };
      const body = list.sort((x, y) => edge(x[0]) - edge(y[0])).map(([band, v]) => {
        const u = unit[band[6]] ?? words(band[6]);
        const text = band[2] != null ? `below ${number(band[2])} ${u}` : band[3] != null ? `from ${number(band[3])} ${u}` : `${number(band[4])} to ${number(band[5])} ${u}`;
        const inner = el("i"), bar = el("span", { class: "meter wide" }, inner);
        inner.style.width = `${v / sum * 100}%`;
        return cells([text, bar, v ? `${fixed(v / sum * 100, v / sum < 0.1 ? 1 : 0)} %` : "", v ? span(v) : ""], ["t", "", "n", "n"]);
      });
      return el("div", { class: "panel scroll" }, el("h3", {}, words(name)), el("table", {}, el("tbody", {}, body)));
    }).filter(Boolean);
    wear.append(el("h3", { class: "above" }, "Counters"), el("div", { class: "split" },
      el("div", { class: "panel scroll tall" }, rows([["Counter"], heading, ever], plain)),
      numbers.length ? el("div", { class: "panel scroll" }, motorTable) : null));
    if (histograms.length) wear.append(el("h3", { class: "above" }, "Time spent in ranges"), el("div", { class: "split" }, histograms));
  } else {
    wear.append(el("p", { class: "dim" }, "This log has no usage counters: it was packed from a recording, or it ended before the first."));
  }

  // Trend.
  const trend = data.trend;
  if (trend.sessions.length > 1 && trend.rows.length) {
    const host = section("trend", "Trend");
    const spark = (values) => {
      const known = values.filter((v) => v != null);
      const low = Math.min(...known), high = Math.max(...known);
      const node = svg("svg", { class: "spark", viewBox: "0 0 150 26", "aria-hidden": "true" });
      const x = (i) => 5 + i / Math.max(values.length - 1, 1) * 140;
      const y = (v) => high === low ? 13 : 22 - (v - low) / (high - low) * 18;
      const path = values.map((v, i) => v == null ? null : `${x(i).toFixed(1)},${y(v).toFixed(1)}`).filter(Boolean);
      node.append(svg("polyline", { points: path.join(" "), fill: "none", stroke: "currentColor", "stroke-width": 1.5, opacity: .6 }));
      const last = values[values.length - 1];
      if (last != null) node.append(svg("circle", { cx: x(values.length - 1), cy: y(last), r: 3.5, fill: "var(--accent)" }));
      return node;
    };
    const show = (v, unit) => v == null ? "" : unit === "s" ? span(v) : `${Number(v.toPrecision(4))} ${unit}`.trim();
    host.append(
      el("p", { class: "dim" }, `This session against the ${plural(trend.sessions.length - 1, "session")} before it on the same card, of the same vehicle.`),
      el("div", { class: "panel scroll" }, rows([["Quantity"], [`${trend.sessions[0].name} \u2192 ${log.name}`], ["Median before", "n"], ["This session", "n"], ["Change", "n"]],
        trend.rows.map((row) => {
          const before = row.values.slice(0, -1).filter((v) => v != null).sort((a, b) => a - b);
          const median = before.length ? (before[(before.length - 1) >> 1] + before[before.length >> 1]) / 2 : null;
          const now = row.values[row.values.length - 1];
          const change = median && now != null ? (now / median - 1) * 100 : null;
          return cells([row.title, spark(row.values), show(median, row.unit), show(now, row.unit),
            change == null ? "" : change >= 1000 ? "over +1000 %" : `${change >= 0 ? "+" : "\u2212"}${fixed(Math.abs(change), 0)} %`], ["", "", "n", "n", "n"]);
        }))));
  }

  // The recorder.
  const recorder = section("recorder", "Recorder");
  const stats = data.stats;
  recorder.append(el("div", { class: "split" },
    el("div", { class: "panel" }, facts([
      ["Frames", `${whole(log.frames)} recorded, ${whole(log.frames_missing)} missing`],
      ["Records", whole(log.records)],
      ["Size", `${bytes(log.log_bytes)}; as a tlog ${bytes(log.tlog_bytes)}: ${fixed(log.ratio, 2)} times smaller`],
      ["Sectors", `${whole(log.sectors)}, ${whole(log.sectors_damaged)} damaged`],
      ["Ending", log.closed ? "in order" : "by power-off"],
      ["Received", stats && `${whole(stats.frames_in)} frames, ${bytes(stats.bytes_in)}, of which ${bytes(stats.bytes_not_frames)} were no frame`],
      ["Queue, fullest", stats && stats.queue_bytes_capacity ? `${bytes(stats.queue_bytes_max)} of ${bytes(stats.queue_bytes_capacity)} (${fixed(stats.queue_bytes_max / stats.queue_bytes_capacity * 100, 0)} %)` : null],
      ["Card, longest stall", stats && `${whole(stats.sd_stall_ms_max)} ms`],
      ["To the ground station", stats && `${whole(stats.gs_frames)} frames, ${bytes(stats.gs_bytes)}`],
    ])),
    el("div", { class: "panel scroll" },
      log.gaps.length || log.losses.length ? rows([["What"], ["From", "n"], ["To", "n"], ["How much", "n"]], [
        ...log.gaps.map((g) => cells([`gap: ${g.cause}, ${plural(g.sectors_lost + g.sectors_skipped, "sector")}`,
          g.from_s == null ? "the beginning" : fixed(g.from_s - start, 3) + " s", g.to_s == null ? "the end" : fixed(g.to_s - start, 3) + " s",
          g.frames_missing == null ? "unknown" : plural(g.frames_missing, "frame")], ["", "n", "n", "n"], { class: "gap" })),
        ...log.losses.map((l) => cells([`lost: ${words(l.what)}`, fixed(l.from_s - start, 3) + " s", fixed(l.to_s - start, 3) + " s", whole(l.count)], ["", "n", "n", "n"])),
      ]) : el("p", { class: "ok" }, "No gap, no loss: every frame that arrived is here."),
      log.gaps_count > log.gaps.length ? el("p", { class: "dim" }, `and ${whole(log.gaps_count - log.gaps.length)} more gaps`) : null)));

  // What the vehicle said, and what it sent.
  const SEVERITIES = ["emergency", "alert", "critical", "error", "warning", "notice", "info", "debug"];
  const levelOf = (severity) => severity <= 3 ? "critical" : severity === 4 ? "warning" : severity === 5 ? "advisory" : "stale";
  const said = section("messages", "Messages");
  said.append(el("div", { class: "split" },
    el("div", { class: "panel scroll tall" }, data.texts.length
      ? rows([["Time", "n"], ["Severity"], ["Text"]], data.texts.map((t) => cells([
        fixed(t.at_s - start, 1) + " s", el("span", { class: `badge ${levelOf(t.severity)}` }, SEVERITIES[t.severity] ?? String(t.severity)), t.text],
        ["n", "t", "words"], { class: "text" })))
      : el("p", { class: "dim" }, "The vehicle said nothing in words."),
      data.texts_count > data.texts.length ? el("p", { class: "dim" }, `and ${whole(data.texts_count - data.texts.length)} more`) : null),
    el("div", { class: "panel scroll tall" }, rows([["Message"], ["Frames", "n"], ["per s", "n"]], [...log.messages].sort((a, b) => b.frames - a.frames).map((m) =>
      cells([m.name + (m.verified ? "" : " (unverified)"), whole(m.frames), fixed(m.frames / Math.max(log.duration_s, 1), 2)], ["words", "n", "n"]))))));

  document.getElementById("foot").append(`Made by hums ${data.version}. Times count from the session's start; intervals of ${grid.interval_s >= 1 ? grid.interval_s + " s" : grid.interval_s * 1000 + " ms"} keep their lowest and highest value. Plots: uPlot, MIT.`);
  bar.append(back);

  // ---- Redrawing.
  const redraw = () => { for (const chart of charts) chart.draw(); drawStrip(); if (places) paintMap(); };
  const fit = () => { for (const chart of charts) chart.resize(); drawStrip(); drawMap(); };
  drawStrip();
  drawMap();
  let width = main.clientWidth;
  new ResizeObserver(() => {
    if (main.clientWidth === width) return;
    width = main.clientWidth;
    fit();
  }).observe(main);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("beforeprint", () => { root.classList.add("printing"); redraw(); fit(); });
  addEventListener("afterprint", () => { root.classList.remove("printing"); redraw(); });
  root.dataset.ready = "true";
})();
