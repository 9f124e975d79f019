"""Usage of each recorded flight, computed independently from pymavlink's messages.

usage: usage.py DIALECT.py FILE...        prints JSON: file name -> figures

The figures of docs/usage.md, computed after the flight from all of it:

  flights, flight_time_s    from EXTENDED_SYS_STATE if it reports in the air or on the ground; otherwise armed and 1.5 m
                            above the place of arming for half a second, until the throttle is below 20 %, half of that of a hover (without VFR_HUD:
                            until it is low and still) for two seconds or until it is disarmed
  armed_time_s              base_mode of the vehicle's heartbeats
  distance_m, speed_max_m_s the horizontal speed of GLOBAL_POSITION_INT in the air, times the time to the next one
  height_max_m              relative_alt of GLOBAL_POSITION_INT in the air
  charge_ah, energy_wh      BATTERY_STATUS of all batteries, else SYS_STATUS, else (no current there) ESC_STATUS of all
                            motors, each figure until the next one, 5 s at most (ESC 2 s)
  current_max_a, voltage_min_v, vibration_max_m_s2        of the same messages and of VIBRATION, while armed
  load_factor_max_g         the norm of the first accelerometer, each axis through a first-order filter of 0.3 s, in the air and where
                            VIBRATION is below 60

A recording without times (raw) counts as a line at 115,200 baud.
"""

import json
import math
import os
import sys

from manifest import Reader, frame_at, is_tlog, load_dialect

BATTERY_HOLD_S, ESC_HOLD_S, MOTION_HOLD_S, STATE_HOLD_S = 5.0, 2.0, 3.0, 5.0
LINE_BYTES_PER_S = 11_520
INVALID_AUTOPILOT = 8
GRAVITY = 9.80665
# Limits: a manoeuvre, and the range of sensors; vibration without a valid load factor, and the time for which a report holds.
LOAD_FILTER_S, LOAD_MAX_G = 0.3, 60.0
SHAKES_M_S2, SHAKEN_S = 60.0, 3.0
# BATTERY_STATUS and SYS_STATUS: -1, and PX4's number for its own -1 A.
UNKNOWN_CURRENT = (-1, -100)
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4


def messages_of(data, dialect):
    """Each verified message with its time in seconds, which never goes back."""
    reader, at, tlog = Reader(dialect), 0, is_tlog(data)
    skip = 8 if tlog else 0
    time_s = first = None
    while at + skip < len(data):
        found = frame_at(data, at + skip)
        if found is None:
            at += 1
            continue
        length, message_id = found
        frame = data[at + skip:at + skip + length]
        if not reader.verifies(frame, message_id):
            at += skip + length if tlog else 1
            continue
        stamp = int.from_bytes(data[at:at + 8], "big") / 1e6 if tlog else (at + length) / LINE_BYTES_PER_S
        first = stamp if first is None else first
        time_s = stamp - first if time_s is None else max(time_s, stamp - first)
        yield time_s, reader.mav.decode(bytearray(frame))
        at += skip + length


class Series:
    """Values with their times, each of which holds until the next, or `hold_s` at most."""

    def __init__(self, hold_s):
        self.hold_s, self.items = hold_s, []

    def add(self, time_s, value):
        self.items.append((time_s, value))

    def spans(self, end_s):
        for (start, value), following in zip(self.items, self.items[1:] + [(end_s, None)]):
            yield start, min(following[0], start + self.hold_s), value


def overlap(start, end, ranges):
    return sum(max(0.0, min(end, stop) - max(start, begin)) for begin, stop in ranges)


def within(time_s, ranges):
    return any(begin <= time_s <= stop for begin, stop in ranges)


def ranges_where(samples, end_s):
    """The ranges of time in which the last sample was true."""
    ranges, begin = [], None
    for time_s, value in samples:
        if value and begin is None:
            begin = time_s
        elif not value and begin is not None:
            ranges.append((begin, time_s))
            begin = None
    return ranges + ([(begin, end_s)] if begin is not None else [])


def vehicle_of(messages):
    for _, message in messages:
        if message.get_type() == "HEARTBEAT" and message.autopilot != INVALID_AUTOPILOT:
            return message.get_srcSystem(), message.get_srcComponent()
    return None


class Flight:
    """All inputs of the figures, in the order of arrival."""

    def __init__(self, messages):
        self.armed, self.landed, self.positions, self.hud, self.throttles = [], [], [], [], []
        self.batteries, self.system, self.motors = {}, Series(BATTERY_HOLD_S), {}
        self.kind = 0
        self.end_s = messages[-1][0] if messages else 0.0
        vehicle = vehicle_of(messages)
        for time_s, message in messages:
            if (message.get_srcSystem(), message.get_srcComponent()) == vehicle:
                take = getattr(self, message.get_type().lower(), None)
                if callable(take):
                    take(time_s, message)

    def heartbeat(self, time_s, message):
        self.kind = message.type
        self.armed.append((time_s, bool(message.base_mode & 128)))

    def extended_sys_state(self, time_s, message):
        self.landed.append((time_s, message.landed_state))

    def global_position_int(self, time_s, message):
        speed = math.hypot(message.vx, message.vy) / 100
        self.positions.append((time_s, message.relative_alt / 1000, speed))

    def vfr_hud(self, time_s, message):
        self.hud.append((time_s, message.groundspeed))
        self.throttles.append((time_s, message.throttle))

    def battery_status(self, time_s, message):
        cells = [value for value in message.voltages if value != 65535]
        volts = sum(cells) / 1000 if cells else None
        amperes = None if message.current_battery in UNKNOWN_CURRENT else message.current_battery / 100
        self.batteries.setdefault(message.id, Series(BATTERY_HOLD_S)).add(time_s, (volts, amperes))

    def sys_status(self, time_s, message):
        volts = None if message.voltage_battery in (0, 65535) else message.voltage_battery / 1000
        amperes = None if message.current_battery in UNKNOWN_CURRENT else message.current_battery / 100
        self.system.add(time_s, (volts, amperes))

    def esc_status(self, time_s, message):
        for offset, (volts, amperes) in enumerate(zip(message.voltage, message.current)):
            motor = self.motors.setdefault(message.index + offset, Series(ESC_HOLD_S))
            motor.add(time_s, (volts, amperes))

    def armed_ranges(self):
        return ranges_where(self.armed, self.end_s)

    def air_ranges(self):
        """In the air, by the autopilot's report if there is one, by height otherwise."""
        armed = self.armed_ranges()
        if any(state in (IN_AIR, LANDING) for _, state in self.landed):
            return self.said(armed)
        if self.kind in (10, 11, 12):
            return []
        ranges = []
        for begin, end in armed:
            heights = [sample for sample in self.positions if sample[0] <= begin]
            ground_m = heights[-1][1] if heights and begin - heights[-1][0] <= MOTION_HOLD_S else 0.0
            ranges += self.hops([sample for sample in self.positions if begin <= sample[0] <= end], ground_m, end)
        return ranges

    def said(self, armed):
        """By the autopilot's report; during a take-off, which begins on the ground, a metre of height decides."""
        events = [(time_s, state, None) for time_s, state in self.landed]
        events += [(time_s, None, height) for time_s, height, _ in self.positions if within(time_s, armed)]
        samples, state, ground_m = [], ON_GROUND, None
        for time_s, said, height in sorted(events, key=lambda event: event[0]):
            if said is not None:
                state = said
                if said != TAKING_OFF:
                    samples.append((time_s, said in (IN_AIR, LANDING)))
            else:
                ground_m = height if ground_m is None else ground_m
                if state == TAKING_OFF and height - ground_m > 1.0:
                    samples.append((time_s, True))
        return ranges_where(samples, self.end_s)

    def hops(self, samples, ground_m, end_s):
        """The times in the air while armed."""
        ranges, since, since_low = [], None, None
        throttles, throttle = iter(self.throttles), 0
        following = next(throttles, None)
        for time_s, height, speed in samples:
            while following is not None and following[0] <= time_s:
                throttle, following = following[1], next(throttles, None)
            height -= ground_m
            if since is None or not ranges or ranges[-1][1] is not None:
                since = (since if since is not None else time_s) if height > 1.5 else None
                if since is not None and time_s - since >= 0.5:
                    ranges.append((since, None))
                    since_low = None
            elif (throttle >= 20) if self.throttles else (height > 0.5 or speed > 0.5):
                since_low = None
            else:
                since_low = time_s if since_low is None else since_low
                if time_s - since_low >= 2.0:
                    ranges[-1], since = (ranges[-1][0], since_low), None
        last_s = end_s if since_low is None else since_low
        return [(begin, last_s if end is None else end) for begin, end in ranges]

    def drawn(self):
        """(series of volts and amperes) of all consumers; the first one gives the voltage."""
        batteries = [self.batteries[key] for key in sorted(self.batteries)] or [self.system]
        known = any(amperes is not None for series in batteries for _, (_, amperes) in series.items)
        return batteries, batteries if known else list(self.motors.values())


def figures(messages):
    flight = Flight(messages)
    air, armed = flight.air_ranges(), flight.armed_ranges()
    duration = lambda ranges: sum(end - begin for begin, end in ranges)
    found = {
        "flights": len(air),
        "landings": sum(end < flight.end_s for _, end in air),
        "flight_time_s": duration(air),
        "armed_time_s": duration(armed),
    }
    speeds = Series(MOTION_HOLD_S)
    for time_s, _, speed in flight.positions:
        speeds.add(time_s, speed)
    if not flight.positions:
        for time_s, speed in flight.hud:
            speeds.add(time_s, speed)
    found["distance_m"] = sum(
        overlap(start, end, air) * speed for start, end, speed in speeds.spans(flight.end_s))
    most = lambda values: max(values, default=0.0)
    found["speed_max_m_s"] = most(speed for time_s, speed in speeds.items if within(time_s, air))
    found["height_max_m"] = most(height for time_s, height, _ in flight.positions if within(time_s, air))
    batteries, sources = flight.drawn()
    charge = energy = 0.0
    for series in sources:
        for start, end, (volts, amperes) in series.spans(flight.end_s):
            charge += max(amperes or 0.0, 0.0) * (end - start) / 3600
            energy += max(amperes or 0.0, 0.0) * (volts or 0.0) * (end - start) / 3600
    found["charge_ah"], found["energy_wh"] = charge, energy
    volts = [value[0] for time_s, value in batteries[0].items if value[0] and within(time_s, armed)]
    found["voltage_min_v"] = min(volts, default=None)
    found["current_max_a"] = current_max(sources, armed)
    found["vibration_max_m_s2"] = most(
        max(message.vibration_x, message.vibration_y, message.vibration_z)
        for time_s, message in messages if message.get_type() == "VIBRATION" and within(time_s, armed))
    found["load_factor_max_g"] = most(
        load_g for time_s, load_g in load_factors(messages) if within(time_s, air))
    return found


def current_max(sources, armed):
    """The highest sum of all of them."""
    now, most = {}, 0.0
    events = [(time_s, place, value[1]) for place, series in enumerate(sources) for time_s, value in series.items]
    for time_s, place, amperes in sorted(events, key=lambda event: event[0]):
        now[place] = max(amperes or 0.0, 0.0)
        if within(time_s, armed):
            most = max(most, sum(now.values()))
    return most


def load_factors(messages):
    """The time and the load factor of each sample, if vibration allows one."""
    force, before_s, shaken_s = None, None, -math.inf
    for time_s, message in messages:
        if message.get_type() == "VIBRATION":
            most = max(message.vibration_x, message.vibration_y, message.vibration_z)
            shaken_s = time_s if most >= SHAKES_M_S2 else -math.inf
        sample = specific_force(message)
        if sample is None or norm(sample) > LOAD_MAX_G * GRAVITY:
            continue
        step_s = math.inf if force is None else time_s - before_s
        if step_s > 0:
            weight = step_s / (LOAD_FILTER_S + step_s) if step_s < 1 else 1.0
            force = sample if force is None else [old + weight * (new - old) for old, new in zip(force, sample)]
            before_s = time_s
        if time_s - shaken_s > SHAKEN_S:
            yield time_s, norm(force) / GRAVITY


def specific_force(message):
    if message.get_type() not in ("RAW_IMU", "SCALED_IMU", "HIGHRES_IMU") or getattr(message, "id", 0) != 0:
        return None
    force = [message.xacc, message.yacc, message.zacc]
    if message.get_type() == "HIGHRES_IMU":
        return force if message.fields_updated & 7 == 7 else None
    return [axis * GRAVITY / 1000 for axis in force]


def norm(vector):
    return math.sqrt(sum(axis * axis for axis in vector))


def main():
    dialect = load_dialect(sys.argv[1])
    found = {}
    for path in sys.argv[2:]:
        with open(path, "rb") as file:
            found[os.path.basename(path)] = figures(list(messages_of(file.read(), dialect)))
    print(json.dumps(found))


if __name__ == "__main__":
    main()
