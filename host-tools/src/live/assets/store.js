// The history of one vehicle: series as intervals with a lowest and a highest value, the track, and notes.

export const store = () => {
  let lines = new Map(), start = 0, step = 1, version = 0;
  const self = {
    vehicle: null, notes: [], track: [],
    // Counts up with every change: who draws knows whether to.
    get version() { return version; },
    // Takes a part; returns the notes that are new since the page looks.
    take(part) {
      const anew = part.reset || part.vehicle !== self.vehicle;
      if (anew) {
        lines = new Map();
        self.notes = [];
        self.track = [];
        self.vehicle = part.vehicle;
      }
      start = part.start_s;
      step = part.step_s;
      version++;
      for (const [key, [numbers, values]] of Object.entries(part.series)) {
        if (!lines.has(key)) lines.set(key, { numbers: [], values: [] });
        const line = lines.get(key);
        numbers.forEach((number, i) => {
          // The newest interval is told again as long as it grows.
          while (line.numbers.length && line.numbers[line.numbers.length - 1] >= number) {
            line.numbers.pop();
            line.values.length -= 2;
          }
          line.numbers.push(number);
          line.values.push(values[2 * i], values[2 * i + 1]);
        });
      }
      self.notes.push(...part.notes);
      self.track.push(...part.track);
      return anew ? [] : part.notes;
    },
    has: (key) => lines.has(key),
    // How many lines a plot has: their numbers need not follow each other.
    numbers: (plot) => [...lines.keys()].filter((key) => key.startsWith(plot + ":")).map((key) => Number(key.slice(plot.length + 1))).sort((a, b) => a - b),
    // Columns for uPlot: times, then a column a line, from a time on. `undefined` is "goes on", `null` is "breaks".
    table(plot, numbers, from) {
      const first = Math.floor((from - start) / step) - 1;
      const parts = numbers.map((number) => {
        const line = lines.get(`${plot}:${number}`);
        if (!line) return null;
        let low = 0, high = line.numbers.length;
        while (low < high) {
          const middle = (low + high) >> 1;
          if (line.numbers[middle] < first) low = middle + 1; else high = middle;
        }
        return { line, at: low };
      });
      const times = [], columns = numbers.map(() => []);
      const last = numbers.map(() => null);
      const silence = Math.max(6, 5 / step);
      for (;;) {
        let next = Infinity;
        for (const part of parts) if (part && part.at < part.line.numbers.length) next = Math.min(next, part.line.numbers[part.at]);
        if (next === Infinity) break;
        times.push(start + (next + 0.25) * step, start + (next + 0.75) * step);
        parts.forEach((part, i) => {
          const column = columns[i];
          if (!part || part.line.numbers[part.at] !== next) { column.push(undefined, undefined); return; }
          if (last[i] != null && next - last[i] > silence) {
            for (let k = column.length - 1; k >= 0 && column[k] === undefined; k--) column[k] = null;
          }
          column.push(part.line.values[2 * part.at], part.line.values[2 * part.at + 1]);
          last[i] = next;
          part.at++;
        });
      }
      return [times, ...columns];
    },
  };
  return self;
};
