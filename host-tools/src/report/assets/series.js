// Series: intervals with a lowest and a highest value, as two points each.

import { grid } from "./data.js";

const expand = (series) => {
  const points = new Map();
  let at = 0;
  series.steps.forEach((step, i) => {
    at += step;
    points.set(at, [series.values[2 * i], series.values[2 * i + 1]]);
  });
  return points;
};
export const table = (plot) => {
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
