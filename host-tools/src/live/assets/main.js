// What comes from hums goes to the instruments, at most once a frame.

import { badge } from "./badge.js";
import { say, attribute, toggle } from "./dom.js";
import { el } from "./elements.js";
import { age, whole } from "./shown.js";
import { words } from "./text.js";
import { board, usage, link } from "./health.js";
import { condition } from "./condition.js";
import { connect } from "./link.js";
import { esc } from "./esc.js";
import { general } from "./general.js";
import { keys } from "./keys.js";
import { movement } from "./movement.js";
import { notes } from "./notes.js";
import { player } from "./player.js";
import { sound } from "./sound.js";
import { store } from "./store.js";
import { WINDOWS, getWindow, setWindow } from "./plot.js";

const root = document.documentElement;
const history = store(), speaker = sound();
let head = null, state = null, marks = {}, connected = false, lostAt = null, anew = false, dirty = false, failures = 0, tokenGiven = false;
// The session begins where the first thing was heard.
let start = null;

// ---- Head.
const overall = badge(), name = el("h1", {}, "HUMS"), facts = el("p", { class: "facts-line" }), picture = badge();
const armed = el("b", { class: "chip", "data-value": "armed" }), phase = el("b", { class: "chip", "data-value": "phase" });
const vehicles = el("div", { class: "vehicles", role: "group", "aria-label": "Vehicles" });
const speak = el("button", { type: "button", "aria-pressed": "false", title: "Findings aloud (M)", onclick: () => loud() }, "Sound off");
const range = el("button", { type: "button", title: "What plots show (W)", onclick: () => nextWindow() }, "");
const asked = el("button", { type: "button", title: "Keys (?)", "aria-label": "Help", onclick: () => shortcuts.help() }, "?");
document.getElementById("head").append(
  el("div", { class: "who" }, overall.node, el("div", {}, name, facts)),
  el("div", { class: "chips" }, armed, phase, picture.node),
  vehicles, el("div", { class: "tools" }, range, speak, asked));
overall.node.id = "overall";
picture.node.id = "source";

// ---- Body.
const rows = [general(), esc(), movement(), condition()], sides = [board(), usage(), link()];
const wire = connect(take, (now, count, token) => {
  connected = now;
  failures = count;
  tokenGiven = token;
  lostAt = now ? null : lostAt ?? performance.now();
  stir();
});
const time = player((command) => wire.send(command)), log = notes((to) => time.seek(to));
document.getElementById("player").append(time.node);
const notice = document.getElementById("notice"), main = document.getElementById("main");
// On a phone one column: health first, as the reader wants to know first whether all is well.
main.append(el("div", { class: "rows" }, rows.map((row) => row.node)), el("aside", {}, sides[0].node, log.node, sides[2].node, sides[1].node));

const loud = () => {
  speaker.toggle();
  attribute(speak, "aria-pressed", String(speaker.on));
  say(speak, speaker.on ? "Sound on" : "Sound off");
};
const nextWindow = () => {
  const index = WINDOWS.findIndex(([, seconds]) => seconds === getWindow());
  const [label, seconds] = WINDOWS[(index + 1) % WINDOWS.length];
  setWindow(seconds);
  say(range, `Plots: ${label}`);
  stir();
};
say(range, `Plots: ${WINDOWS[0][0]}`);
const choose = (index) => { const one = head?.vehicles[index]; if (one) wire.follow(one.system); };
const shortcuts = keys({ player: time, sound: loud, window: nextWindow, vehicle: choose });

function take(message) {
  if (message.t === "head") head = message;
  else if (message.t === "state") state = message;
  else if (message.t === "timeline") marks = message.marks;
  else if (message.t === "history") {
    if (message.reset) { anew = true; start = null; }
    const fresh = history.take(message);
    speaker.tell(fresh);
  }
  stir();
}

function stir() {
  if (!dirty) {
    dirty = true;
    requestAnimationFrame(draw);
  }
}

const PHASES = { waiting: "stale", live: "ok", silent: "stale", lost: "critical", reading: "advisory", playing: "ok", paused: "advisory", ended: "advisory" };

const drawHead = () => {
  const { source } = head;
  const said = { live: "live", waiting: "waiting", silent: "silent", lost: "lost", reading: `reading ${whole(source.progress * 100)} %` }[source.phase] ?? source.phase;
  picture.set(connected ? PHASES[source.phase] ?? "stale" : "critical", connected ? said : "no connection");
  const utc = head.utc_ms == null ? "" : ` \u00b7 ${new Date(head.utc_ms).toISOString().slice(0, 19).replace("T", " ")} UTC`;
  say(facts, `${source.name}${utc}`);
  if (vehicles.children.length !== (head.vehicles.length > 1 ? head.vehicles.length : 0)) {
    vehicles.replaceChildren(...(head.vehicles.length > 1 ? head.vehicles : []).map((_, i) => el("button", { type: "button", onclick: () => choose(i) })));
  }
  [...vehicles.children].forEach((button, i) => {
    const one = head.vehicles[i];
    say(button, `${one.system} \u00b7 ${one.name} \u00b7 ${!connected ? "not known" : one.heard_ms > 5000 ? "silent" : one.overall}`);
    attribute(button, "aria-pressed", String(one.system === state?.vehicle));
    attribute(button, "class", connected ? one.overall : "stale");
  });
  time.update(head);
  toggle(root, "playing-back", time.recording);
  const silent = state && state.heard_ms > 3000 && source.phase !== "reading";
  const words = !connected ? failures > 3 && lostAt && !head.now_s && !tokenGiven ? "hums does not answer, or wants the token that stands in the address that it printed." : `No connection to hums: what stands here is ${age(performance.now() - (lostAt ?? 0))} old.`
    : source.phase === "reading" ? `Reading ${source.name}: ${whole(source.progress * 100)} %`
    : source.phase === "lost" ? `The link is lost, and tried again every second: ${source.words}`
    : source.words ? source.words
    : source.phase === "waiting" ? `Waiting for the first frame on ${source.name}.`
    : !state ? "Frames come, but no autopilot's heartbeat yet."
    : silent ? `The autopilot has been silent for ${age(state.heard_ms)}: values are its last ones.` : "";
  notice.hidden = !words;
  say(notice, words);
  // What was last heard of the vehicle is not known to be so any longer.
  if (!connected) {
    overall.set("stale", "not known");
    document.title = "NO CONNECTION \u00b7 HUMS live";
  }
  toggle(root, "cut", !connected || Boolean(silent) || source.phase === "lost");
};

const drawState = () => {
  say(name, `${state.name}${state.firmware ? " " + state.firmware : ""}`);
  if (connected) document.title = `${state.overall === "ok" ? "" : state.overall.toUpperCase() + " \u00b7 "}${state.name} \u00b7 HUMS live`;
  if (connected) overall.set(state.overall);
  say(armed, state.armed ? "armed" : "disarmed");
  toggle(armed, "hot", state.armed);
  say(phase, state.airborne ? words(state.phase) : "on the ground");
  const from = start ?? (start = head?.source.recording ? head.source.start_s : 0);
  for (const row of rows) row.update(state, history, from);
  for (const side of sides) side.update(state, head);
  log.update(history, from, anew);
  anew = false;
  time.marks(marks[state.vehicle]);
};

function draw() {
  dirty = false;
  toggle(root, "unknown", !state);
  if (head) drawHead();
  else if (!connected && failures > 1) {
    notice.hidden = false;
    say(notice, tokenGiven ? "hums does not take this token: use the address that it printed." : "hums does not answer, or wants the token that stands in the address that it printed.");
  }
  if (head && state && state.vehicle === history.vehicle) drawState();
  root.dataset.ready = String(Boolean(state));
  root.dataset.now = state?.now_s ?? "";
}
// Ages go on while nothing comes.
setInterval(() => { if (!connected) stir(); }, 500);
toggle(root, "unknown", true);
