// The page of a flight that grows: what comes from hums goes to the instruments and plots, at most once a frame.

import { badge } from "./badge.js";
import { bench } from "./bench.js";
import { condition } from "./condition.js";
import { attribute, say, toggle } from "./dom.js";
import { el } from "./elements.js";
import { esc } from "./esc.js";
import { flight } from "./flight.js";
import { general } from "./general.js";
import { board, link, usage } from "./health.js";
import { keys } from "./keys.js";
import { bar, main, section } from "./layout.js";
import { connect } from "./link.js";
import { movement } from "./movement.js";
import { notes } from "./notes.js";
import { parameters } from "./parameters.js";
import { player } from "./player.js";
import { charts } from "./plot.js";
import { plots } from "./plots.js";
import { sound } from "./sound.js";
import { age, whole, words } from "./text.js";
import { timeline } from "./timeline.js";
import { back, cursorTime, follow, lookAt, usually } from "./view.js";

const root = document.documentElement;
const speaker = sound();
let head = null,
  state = null,
  marks = {},
  connected = false,
  lostAt = null,
  anew = false,
  dirty = false,
  failures = 0,
  tokenGiven = false;
// The session begins where the first thing was heard.
let begun = false;

// ---- What plots show while nobody has looked closer.
const WINDOWS = [
  ["1 min", 60],
  ["5 min", 300],
  ["whole flight", Infinity],
];
let shownWindow = 0,
  shownAt = 0;
usually(() => {
  const [, seconds] = WINDOWS[shownWindow],
    from = Math.max(flight.start, shownAt - seconds);
  return [from, Math.max(shownAt, from + Math.min(seconds, 10))];
});

// ---- Head.
const overall = badge(),
  name = el("h1", {}, "HUMS"),
  facts = el("p", { class: "facts-line" }),
  why = el("p", { class: "verdict", id: "why", hidden: true }),
  picture = badge();
const armed = el("b", { class: "chip", "data-value": "armed" }),
  phase = el("b", { class: "chip", "data-value": "phase" });
const vehicles = el("div", { class: "vehicles", role: "group", "aria-label": "Vehicles" });
const speak = el("button", { type: "button", "aria-pressed": "false", title: "Findings aloud (M)", onclick: () => loud() }, "Sound off");
const range = el("button", { type: "button", title: "What plots show (W)", onclick: () => nextWindow() }, "");
const asked = el("button", { type: "button", title: "Keys (?)", "aria-label": "Help", onclick: () => shortcuts.help() }, "?");
document
  .getElementById("head")
  .append(
    el("div", { class: "who" }, overall.node, el("div", {}, name, facts)),
    el("div", { class: "chips" }, armed, phase, picture.node),
    vehicles,
    el("div", { class: "tools" }, back, range, speak, asked),
    why,
  );
overall.node.id = "overall";
picture.node.id = "source";

// ---- Body.
const rows = [movement(), general(), esc(), condition()],
  sides = [board(), usage(), link()],
  body = el("div", { class: "rows" });
const linked = (now, count, token) => {
  connected = now;
  failures = count;
  tokenGiven = token;
  lostAt = now ? null : (lostAt ?? performance.now());
  stir();
};
const wire = connect(take, linked, () => speaker.on);
const ask = () => wire.send({ cmd: "check", to: state?.vehicle ?? null });
const check = bench(ask, () => head?.source.name ?? "SRC");
const time = player((command) => wire.send(command), stir);
const go = (at) => {
  if (!time.recording) lookAt(at);
  time.seek(at);
};
const log = notes({ go, newestFirst: true, rows: 200 }),
  strip = timeline(go),
  told = parameters();
document.getElementById("player").append(time.node);
const notice = document.getElementById("notice");
notice.after(check.node);
for (const { node } of rows) {
  bar.append(el("a", { href: `#${node.id}` }, node.firstChild.textContent));
  body.append(node);
}
// On a phone one column: health first.
main.append(body, el("aside", {}, sides[0].node, log.node, sides[2].node, sides[1].node), cursorTime);
section("time", "Timeline", body).append(strip.node);
const last = section("parameters", "Parameters", body);
last.append(told.node);
const others = plots((group, next) => section(group.toLowerCase(), group, body, next ?? last), {
  elsewhere: ["MotorAmperes", "MotorVolts", "Height", "Velocity"],
});

const loud = () => {
  speaker.toggle();
  attribute(speak, "aria-pressed", String(speaker.on));
  say(speak, speaker.on ? "Sound on" : "Sound off");
};
const nextWindow = () => {
  shownWindow = (shownWindow + 1) % WINDOWS.length;
  say(range, `Plots: ${WINDOWS[shownWindow][0]}`);
  stir();
};
say(range, `Plots: ${WINDOWS[0][0]}`);
const choose = (index) => {
  const one = head?.vehicles[index];
  if (one) wire.follow(one.system);
};
const shortcuts = keys({ player: time, sound: loud, window: nextWindow, vehicle: choose });

function take(message, text) {
  if (message.t === "head") head = message;
  else if (message.t === "state") {
    state = message;
    time.keep(message, text);
  } else if (message.t === "bench") check.take(message);
  else if (message.t === "timeline") marks = message.marks;
  else if (message.t === "history") {
    if (message.reset) {
      anew = true;
      begun = false;
    }
    speaker.tell(flight.take(message));
  }
  stir();
}

function stir() {
  if (!dirty) {
    dirty = true;
    requestAnimationFrame(draw);
  }
}

const SOURCES = {
  waiting: "stale",
  live: "ok",
  silent: "stale",
  lost: "critical",
  reading: "advisory",
  playing: "ok",
  paused: "advisory",
  ended: "advisory",
};

const NO_ANSWER = "hums does not answer, or wants the token that stands in the address that it printed.";

// What a recording does not have is not good news.
const endsInAir = () => head.source.phase === "ended" && state?.airborne;

const isSilent = ({ phase }) => Boolean(state) && state.heard_ms > 3000 && phase !== "reading";
const isRefused = () => failures > 3 && lostAt && !head.now_s && !tokenGiven;

// What stands over the page: the first of these that holds, and its words.
const NOTICES = [
  [() => !connected && isRefused(), () => NO_ANSWER],
  [() => !connected, () => `No connection to hums: what stands here is ${age(performance.now() - (lostAt ?? 0))} old.`],
  [({ phase }) => phase === "reading", ({ name, progress }) => `Reading ${name}: ${whole(progress * 100)} %`],
  [({ phase }) => phase === "lost", ({ words }) => `The link is lost, and tried again every second: ${words}`],
  [({ words }) => words, ({ words }) => words],
  [
    ({ phase }) => phase === "waiting",
    ({ name }) =>
      `Waiting for the first frame on ${name}. If none comes: is the vehicle's telemetry sent there, and does the firewall let it in?`,
  ],
  [() => !state, () => "Frames come, but no autopilot's heartbeat yet."],
  [isSilent, () => `The autopilot has been silent for ${age(state.heard_ms)}: values are its last ones.`],
  [
    () => endsInAir(),
    ({ log_end: end }) => `The recording ends in the air: what became of the vehicle is not in it.${end ? ` The log: ${end}.` : ""}`,
  ],
  [() => time.held, () => "Paused: instruments and plots show an earlier moment. Level, findings and link are of now."],
];

const drawVehicles = () => {
  const shown = head.vehicles.length > 1 ? head.vehicles : [];
  if (vehicles.children.length !== shown.length) {
    vehicles.replaceChildren(...shown.map((_, i) => el("button", { type: "button", onclick: () => choose(i) })));
  }
  [...vehicles.children].forEach((button, i) => {
    const one = shown[i];
    say(button, `${one.system} \u00b7 ${one.name} \u00b7 ${!connected ? "not known" : one.heard_ms > 5000 ? "silent" : one.overall}`);
    attribute(button, "aria-pressed", String(one.system === state?.vehicle));
    attribute(button, "class", connected ? one.overall : "stale");
  });
};

const drawHead = () => {
  const { source } = head;
  const said =
    source.phase === "reading"
      ? `reading ${whole(source.progress * 100)} %`
      : source.phase === "live" && time.held
        ? "paused"
        : source.phase;
  picture.set(connected ? (SOURCES[source.phase] ?? "stale") : "critical", connected ? said : "no connection");
  const utc = head.utc_ms == null ? "" : ` \u00b7 ${new Date(head.utc_ms).toISOString().slice(0, 19).replace("T", " ")} UTC`;
  say(facts, `${source.name}${utc}`);
  drawVehicles();
  flight.epoch_ms = head.utc_ms == null ? null : head.utc_ms - head.now_s * 1000;
  time.update(head);
  toggle(root, "playing-back", time.recording);
  const silent = isSilent(source);
  const text = NOTICES.find(([holds]) => holds(source))?.[1](source) ?? "";
  notice.hidden = !text;
  say(notice, text);
  // What was last heard of the vehicle is not known to be so any longer.
  if (!connected) {
    overall.set("stale", "not known");
    document.title = "NO CONNECTION \u00b7 HUMS live";
  }
  for (const chip of [armed, phase]) toggle(chip, "stale", !connected || silent);
  toggle(root, "cut", !connected || silent || source.phase === "lost");
};

// Why the level is bad, and what to do: of the worst subsystem.
const drawWhy = () => {
  const worst = ["critical", "warning"].includes(state.overall) ? state.board.find(({ level }) => level === state.overall) : null;
  why.hidden = !connected || !worst?.reason;
  if (why.hidden) return;
  say(why, [`${worst.reason}.`, worst.action].filter(Boolean).join(" "));
  attribute(why, "class", `verdict ${worst.level}`);
};

const drawState = () => {
  say(name, `${state.name}${state.firmware ? ` ${state.firmware}` : ""}`);
  if (connected) document.title = `${state.overall === "ok" ? "" : `${state.overall.toUpperCase()} \u00b7 `}${state.name} \u00b7 HUMS live`;
  if (connected) {
    const words = state.overall_said ?? (state.overall === "stale" ? "not known" : state.overall),
      // What is good at the end of a recording in the air is not known to be good.
      isLast = endsInAir(),
      isCalm = ["ok", "stale", "advisory"].includes(state.overall) && !state.overall_said;
    const level = state.overall_was ?? (isLast && state.overall === "ok" ? "stale" : state.overall);
    overall.set(level, isLast ? `${isCalm ? "" : `${words}; `}ends in the air` : words);
  }
  drawWhy();
  if (!begun) {
    begun = true;
    flight.zero = flight.start = head.source.recording ? head.source.start_s : flight.begin;
  }
  // The moment that the instruments show.
  const shown = time.held ?? state;
  say(armed, shown.armed ? "armed" : "disarmed");
  toggle(armed, "hot", shown.armed);
  const where = shown.airborne ? words(shown.phase) : shown.tells_flight === false ? "not known whether in the air" : "on the ground";
  say(phase, [where, shown.mode].filter(Boolean).join(" \u00b7 "));
  flight.end = Math.max(state.now_s, flight.start + 1);
  shownAt = shown.now_s;
  follow();
  for (const row of rows) row.update(shown);
  sides[0].update(state);
  sides[1].update(shown);
  sides[2].update(state, head);
  others.update();
  for (const one of charts) one.update();
  strip.update();
  told.update();
  log.update(anew);
  anew = false;
  time.marks(marks[state.vehicle]);
};

function draw() {
  dirty = false;
  toggle(root, "unknown", !state);
  check.update(connected && !state?.armed);
  if (head) drawHead();
  else if (!connected && failures > 1) {
    notice.hidden = false;
    say(notice, tokenGiven ? "hums does not take this token: use the address that it printed." : NO_ANSWER);
  }
  if (head && state && state.vehicle === flight.vehicle) drawState();
  root.dataset.ready = String(Boolean(state));
  root.dataset.now = (time.held ?? state)?.now_s ?? "";
}
// Ages go on while nothing comes.
setInterval(() => {
  if (!connected) stir();
}, 500);
toggle(root, "unknown", true);
