// The flight, as hums wrote it into the page.

export const data = JSON.parse(document.getElementById("data").textContent);
export const log = data.log;
export const grid = data.grid;
export const findings = log.findings;

// Seconds since the monitor's power-on.
export const start = log.start_s ?? 0;
export const end = Math.max(log.end_s ?? 0, start + 1);
export const gaps = log.gaps.map((gap) => [gap.from_s ?? start, gap.to_s ?? end, gap]);

const vehicle = log.vehicle;
export const name = vehicle
  ? `${vehicle.autopilot}${vehicle.firmware ? " " + vehicle.firmware : ""} ${vehicle.type}`
  : "Vehicle unknown";
