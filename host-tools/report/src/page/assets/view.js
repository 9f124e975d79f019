// What part of the flight is looked at, and where the cursor stands: plots, strip and map follow.

import { el } from "./elements.js";
import { flight } from "./flight.js";
import { moment } from "./text.js";

// `away` once the user has looked closer: what is looked at stays, also while the flight goes on.
export const view = { from: 0, to: 1, cursor: null, away: false };

const followers = [],
  cursorFollowers = [];
export const whenViewChanges = (follower) => followers.push(follower);
export const whenCursorMoves = (follower) => cursorFollowers.push(follower);

const changed = () => {
  back.hidden = !view.away;
  for (const follower of followers) follower();
};
export const back = el("button", { type: "button", class: "back", hidden: true, onclick: () => home() }, "back to all");
// What is looked at as long as nobody has chosen.
let usual = () => [flight.start, flight.end];
export const home = () => {
  view.away = false;
  [view.from, view.to] = usual();
  changed();
};
export const usually = (range) => {
  usual = range;
  if (!view.away) home();
};
// What is usual is another one now; nobody is told, because whoever goes on draws anyway.
export const follow = () => {
  if (!view.away) [view.from, view.to] = usual();
};
export const look = (from, to) => {
  const [low, high] = [Math.max(from, flight.start), Math.min(to, flight.end)];
  if (!(high - low > 0.01)) return;
  [view.from, view.to, view.away] = [low, high, true];
  changed();
};
export const zoom = (from, to) => {
  const margin = Math.max((to - from) * 0.03, 1);
  look(from - margin, to + margin);
};

// The time under the cursor, of the session and of the day.
const time = el("b"),
  day = el("span");
export const cursorTime = el("p", { class: "cursor-time", hidden: true, "aria-live": "off" }, time, " ", day);
export const utc = (seconds) => (flight.epoch_ms == null ? "" : new Date(flight.epoch_ms + seconds * 1000).toISOString().slice(11, 19));

export const moveCursor = (at) => {
  view.cursor = at;
  cursorTime.hidden = at == null;
  if (at != null) {
    time.textContent = moment(at - flight.zero);
    day.textContent = utc(at) ? `${utc(at)} UTC` : "";
  }
  for (const follower of cursorFollowers) follower();
};
export const lookAt = (at) => {
  const half = Math.max(15, (flight.end - flight.start) / 20);
  look(at - half, at + half);
  moveCursor(at);
};
