// Colours of lines, on light and on dark ground.

// Paul Tol's bright and muted schemes: told apart by colour-blind eyes.
const LINES = [
  ["#2f6fb7", "#5aa2f0"], ["#d1495b", "#ff7a8a"], ["#1f8a4c", "#4cc27c"], ["#b8860b", "#e5b93c"],
  ["#2a9fb5", "#5fd0e6"], ["#a03a8a", "#dd78c6"], ["#6b7680", "#aab4be"], ["#8a5a2b", "#c99a68"],
  ["#4b4fae", "#9296f5"], ["#5f8f1f", "#a4d25a"], ["#c2571a", "#ff9a5c"], ["#177a76", "#4fc9c2"],
  ["#7f3f3f", "#d49a9a"], ["#3f6f7f", "#8fc3d4"],
];

export const lineColour = (index, dark) => LINES[index % LINES.length][dark ? 1 : 0];
