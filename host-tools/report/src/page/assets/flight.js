// The flight: series, track, notes, phases, modes and parameters, in parts as hums tells them. One part may be all of it.

const lines = new Map();

// How often a line is told, in intervals: what is silent much longer is broken.
const usual = (numbers) => {
  const steps = [];
  for (let i = Math.max(1, numbers.length - 100); i < numbers.length; i++) steps.push(numbers[i] - numbers[i - 1]);
  return steps.length ? steps.sort((a, b) => a - b)[steps.length >> 1] : 1;
};
const silence = (line) => Math.max(6 * usual(line.numbers), 6, 5 / flight.step);
// The first place in a row that ascends whose value is not less.
export const place = (row, wanted, of = (value) => value) => {
  let low = 0,
    high = row.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(row[middle]) < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
};
const takeLine = (key, [steps, values]) => {
  if (!lines.has(key)) lines.set(key, { numbers: [], values: [] });
  const line = lines.get(key);
  let number = 0;
  steps.forEach((step, i) => {
    number += step;
    // The newest interval is told again as long as it grows.
    while (line.numbers.length && line.numbers[line.numbers.length - 1] >= number) {
      line.numbers.pop();
      line.values.length -= 2;
    }
    line.numbers.push(number);
    line.values.push(values[2 * i], values[2 * i + 1]);
    flight.last = Math.max(flight.last, flight.begin + number * flight.step);
  });
};
const takeSpans = (row, part) => {
  if (!part) return;
  row.length = Math.min(row.length, part[0]);
  row.push(...part[1]);
};

export const flight = {
  vehicle: null,
  version: 0,
  begin: 0,
  step: 1,
  // What times count from, and where the flight's own time begins.
  zero: 0,
  start: 0,
  end: 1,
  last: 0,
  epoch_ms: null,
  plots: new Map(),
  notes: [],
  notesGone: 0,
  track: [],
  phases: [],
  modes: [],
  parameters: new Map(),
  parametersLeftOut: 0,
  tellsDefaults: false,
  gaps: [],
  flights: [],
  endsInAir: false,
  // Takes a part; returns the notes that are new since the page looks.
  take(part) {
    const anew = part.reset || part.vehicle !== flight.vehicle;
    if (anew) {
      lines.clear();
      flight.parameters.clear();
      Object.assign(flight, { vehicle: part.vehicle, notes: [], track: [], phases: [], modes: [], gaps: [], last: 0 });
    }
    flight.begin = part.start_s;
    flight.step = part.step_s;
    flight.version++;
    if (part.gaps) flight.gaps = part.gaps;
    if (part.plots) flight.plots = new Map(part.plots.map((plot) => [plot.id, plot]));
    for (const [key, told] of Object.entries(part.series)) takeLine(key, told);
    for (const note of part.notes) flight.notes.push(note);
    for (const point of part.track) flight.track.push(point);
    takeSpans(flight.phases, part.phases);
    takeSpans(flight.modes, part.modes);
    for (const { name, values, default: usual } of part.parameters) flight.parameters.set(name, { values, usual });
    flight.tellsDefaults = part.tells_defaults;
    flight.parametersLeftOut = part.parameters_left_out;
    flight.notesGone = part.notes_gone;
    return anew ? [] : part.notes;
  },
  // Warning and critical of a gauge.
  limits: (id) => flight.plots.get(id)?.limits[0] ?? null,
  // The numbers and names of a plot's lines that have a value by now.
  lines: (id) => (flight.plots.get(id)?.lines ?? []).filter(([number]) => lines.has(`${id}:${number}`)),
  // What a line says at a time, or last; null where it was silent then.
  value(id, number, at = null) {
    const line = lines.get(`${id}:${number}`);
    if (!line) return null;
    if (at == null) return line.values[line.values.length - 1];
    const interval = (at - flight.begin) / flight.step,
      i = place(line.numbers, Math.floor(interval) + 1) - 1;
    if (i < 0 || interval - line.numbers[i] > silence(line)) return null;
    return line.values[2 * i + (interval - line.numbers[i] < 0.5 ? 0 : 1)];
  },
  // The lowest and the highest value of a line; null where it has none.
  extremes(id, number) {
    const line = lines.get(`${id}:${number}`);
    return line ? line.values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]) : null;
  },
  // Columns for uPlot: times, then a column a line, of a time. `undefined` is "goes on", `null` is "breaks".
  table(id, numbers, from, to) {
    const first = Math.floor((from - flight.begin) / flight.step) - 1,
      end = Math.ceil((to - flight.begin) / flight.step) + 1;
    const parts = numbers.map((number) => {
      const line = lines.get(`${id}:${number}`);
      // One more on both sides: lines go on beyond the edge.
      return (
        line && {
          line,
          at: Math.max(place(line.numbers, first) - 1, 0),
          stop: place(line.numbers, end) + 1,
          silence: silence(line),
          last: null,
        }
      );
    });
    const times = [],
      columns = numbers.map(() => []);
    // The record has nothing in between: nobody knows how a line goes on there.
    const missing = (last, next) => {
      const [before, behind] = [flight.begin + (last + 1) * flight.step, flight.begin + next * flight.step];
      return flight.gaps.some(([from, to]) => to - from >= flight.step && from <= behind && to >= before);
    };
    let row = null;
    for (;;) {
      let next = Infinity;
      for (const part of parts)
        if (part && part.at < Math.min(part.stop, part.line.numbers.length)) next = Math.min(next, part.line.numbers[part.at]);
      if (next === Infinity) break;
      if (row != null && (next - row > 6 || missing(row, next))) {
        // A place for a break where no line has anything.
        times.push(flight.begin + ((row + 1 + next) / 2) * flight.step);
        for (const column of columns) column.push(undefined);
      }
      row = next;
      times.push(flight.begin + (next + 0.25) * flight.step, flight.begin + (next + 0.75) * flight.step);
      parts.forEach((part, i) => {
        const column = columns[i];
        if (!part || part.at >= part.stop || part.line.numbers[part.at] !== next) {
          column.push(undefined, undefined);
          return;
        }
        if (part.last != null && (next - part.last > part.silence || missing(part.last, next))) {
          // The line breaks where nothing was heard: null in the last place that has no value.
          for (let k = column.length - 1; k >= 0 && column[k] === undefined; k--) column[k] = null;
        }
        column.push(part.line.values[2 * part.at], part.line.values[2 * part.at + 1]);
        part.last = next;
        part.at++;
      });
    }
    return [times, ...columns];
  },
};
