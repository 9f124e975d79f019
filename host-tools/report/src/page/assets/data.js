// The whole flight, as hums wrote it into the page.

import { flight } from "./flight.js";

export const data = JSON.parse(document.getElementById("data").textContent);
export const log = data.log;

if (data.flight) flight.take(data.flight);
flight.epoch_ms = data.epoch_us == null ? null : data.epoch_us / 1000;
// Seconds of the recording's own clock, whose zero is that of `hums check`, `hums info` and `hums decode`.
flight.start = log.start_s ?? 0;
flight.end = Math.max(log.end_s ?? 0, flight.start + 1);
flight.flights = data.flights;
flight.endsInAir = Boolean(data.ends_in_air);

const vehicle = log.vehicle;
export const name = vehicle ? `${vehicle.autopilot}${vehicle.firmware ? ` ${vehicle.firmware}` : ""} ${vehicle.type}` : "Vehicle unknown";
