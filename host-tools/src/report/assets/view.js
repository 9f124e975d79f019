// What part of the session is looked at, and where the cursor stands: plots, strip and map follow.

import { end, start } from "./data.js";
import { el } from "./elements.js";

export const view = { from: start, to: end, cursor: null };

const followers = [], cursorFollowers = [];
export const whenViewChanges = (follower) => followers.push(follower);
export const whenCursorMoves = (follower) => cursorFollowers.push(follower);

export const look = (from, to) => {
  [view.from, view.to] = [from, to];
  back.hidden = from <= start && to >= end;
  for (const follower of followers) follower();
};
export const moveCursor = (at) => {
  view.cursor = at;
  for (const follower of cursorFollowers) follower();
};
export const zoom = (from, to) => {
  const margin = Math.max((to - from) * 0.03, 1);
  look(Math.max(start, from - margin), Math.min(end, to + margin));
  document.getElementById("time").scrollIntoView({ behavior: "smooth" });
};
export const back = el("button", { type: "button", hidden: true, onclick: () => look(start, end) }, "whole session");
