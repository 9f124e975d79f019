"""Take-offs, landings and crashes of each labelled flight, from its recording alone: pymavlink and a few rules, no HUMS.

usage: truth.py DIALECT.py FOLDER        rewrites FOLDER/labels.json

DIALECT.py is made by pymavlink's mavgen. Each entry of labels.json gets four fields:

  flights    from and to of each time in the air, in seconds since the first frame
  landings   the number of them that ended on the ground without a crash
  crashes_s  times of hitting the ground in a crash
  battery_low_s  time of the autopilot's own first report of a low battery; null if it never came

The rules:

  height     above the place of arming: the estimator's (GLOBAL_POSITION_INT.alt); for faults of a barometer the GPS receiver's
  take-off   armed and more than 2 m up for 1 s; the flight began when it was 1 m up
  end        disarmed, a crash, below 1 m for 8 s, or the end of the recording; a vehicle that takes off again 5 s after a crash or
             later flies once more
  crash      it came below 1.5 m with a sink speed of more than 3 m/s in the second before (6 m/s for a plane), or with more
             than 4 g within a second and a speed of more than 1.5 m/s before (a simulator's legs are hard), or was disarmed above 5 m;
             a plane without rotors that touches at less than 3.05 m/s of sink (CS-23.473: a landing gear takes 10 ft/s) and
             without throttle lands, even if it skids; it flies on if it is 2 m up again before it stands
  landing    a flight that ended by disarming or by standing for 8 s, without a crash

  battery    BATTERY_STATUS.charge_state is MAV_BATTERY_CHARGE_STATE_LOW or worse, up to UNHEALTHY

An entry gets none of the first three fields where its heights cannot be trusted: no height for 3 s in the air, more than 8 m below the place
of arming while armed, or the estimator's and the receiver's differ by more than 8 m. Faults of a receiver are known from the estimator alone.
"""

import collections
import gzip
import importlib.util
import json
import math
import os
import struct
import sys

TAKEOFF_M, TAKEOFF_S, BEGAN_M = 2.0, 1.0, 1.0
LANDED_M, LANDED_S = 1.0, 8.0
HIT_M, HIT_S, HIT_M_S, HIT_PLANE_M_S, HIT_G, HIT_G_M_S, GEAR_M_S = 1.5, 1.0, 3.0, 6.0, 4.0, 1.5, 3.05
DISARMED_M = 5.0
WRECK_S = 5.0
LOST_S, DIFFER_M = 3.0, 8.0
HEARTBEAT, GPS_RAW_INT, SCALED_IMU, RAW_IMU, GLOBAL_POSITION_INT, HIGHRES_IMU, BATTERY_STATUS, VFR_HUD, \
    EXTENDED_SYS_STATE = KINDS = 0, 24, 26, 27, 33, 105, 147, 74, 245
CHARGE_LOW, CHARGE_UNHEALTHY, IDLE = 2, 6, 10
GRAVITY = 9.80665
ARMED, AUTOPILOTS, PLANES = 128, (3, 12), (1, 19, 20, 21, 22, 23, 24, 25)


def load_dialect(path):
    spec = importlib.util.spec_from_file_location("hums_dialect", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def messages(dialect, path):
    """(seconds, message) of the kinds that are used."""
    with (gzip.open if path.endswith(".gz") else open)(path, "rb") as file:
        data = file.read()
    mav, at, first = dialect.MAVLink(None), 0, None
    while at + 16 <= len(data):
        time_us = struct.unpack_from(">Q", data, at)[0]
        at += 8
        if data[at] == 0xFD:
            length, number = 12 + data[at + 1] + (13 if data[at + 2] & 1 else 0), int.from_bytes(data[at + 7:at + 10], "little")
        elif data[at] == 0xFE:
            length, number = 8 + data[at + 1], data[at + 5]
        else:
            raise SystemExit(f"{path}: no frame at byte {at}")
        first = time_us if first is None else first
        if number in KINDS:
            try:
                yield (time_us - first) / 1e6, mav.decode(bytearray(data[at:at + length]))
            except dialect.MAVError:
                pass
        at += length


class Flights:
    """The rules, message by message."""

    def __init__(self, label_class):
        self.by_receiver = label_class == "barometer"
        self.compares = label_class not in ("gnss", "barometer")
        self.armed, self.plane, self.known = False, False, True
        self.heights, self.ground, self.receiver, self.receiver_ground = collections.deque(), None, None, None
        self.up_since = self.low_since = self.began = None
        self.flights, self.landings, self.crashes_s = [], 0, []
        self.battery_low_s, self.rotors, self.throttle, self.struck = None, False, 0, None
        self.falling, self.shock, self.speeds = None, -math.inf, collections.deque()

    def take(self, at, message):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            if message.autopilot in AUTOPILOTS and message.get_srcComponent() == 1:
                self.heartbeat(at, bool(message.base_mode & ARMED), message.type)
        elif kind == "VFR_HUD":
            self.throttle = message.throttle
        elif kind == "EXTENDED_SYS_STATE":
            self.rotors = message.vtol_state != 0
        elif kind == "BATTERY_STATUS":
            if CHARGE_LOW <= message.charge_state <= CHARGE_UNHEALTHY and self.battery_low_s is None:
                self.battery_low_s = round(at, 2)
        elif kind == "GPS_RAW_INT" and message.fix_type >= 3:
            self.receiver = message.alt / 1e3
            if self.by_receiver:
                self.height(at, self.receiver)
        elif kind == "GLOBAL_POSITION_INT":
            self.speeds.append((at, math.hypot(message.vx, message.vy, message.vz) / 1e2))
            while self.speeds[0][0] < at - 2 * HIT_S:
                self.speeds.popleft()
            if not self.by_receiver:
                self.height(at, message.alt / 1e3)
        elif kind in ("SCALED_IMU", "RAW_IMU", "HIGHRES_IMU"):
            force = math.hypot(message.xacc, message.yacc, message.zacc)
            if force / (GRAVITY if kind == "HIGHRES_IMU" else 1e3) > HIT_G:
                self.shock = at
                self.hit(at)

    def heartbeat(self, at, armed, kind):
        self.plane = kind in PLANES
        if armed and not self.armed:
            self.ground = self.heights[-1][1] if self.heights else None
            self.receiver_ground = self.receiver
        if self.armed and not armed:
            if self.began is not None and self.above(at) > DISARMED_M:
                self.falling = at
            self.end(at, landed=self.falling is None)
        self.armed = armed
        if self.began is not None and self.heights and at - self.heights[-1][0] > LOST_S:
            self.known = False

    def above(self, at):
        return self.heights[-1][1] - self.ground if self.heights and self.ground is not None else 0.0

    def height(self, at, metres):
        self.heights.append((at, metres))
        while self.heights[0][0] < at - HIT_S:
            self.heights.popleft()
        if self.ground is None:
            self.ground = metres if self.armed else None
            return
        above = metres - self.ground
        self.known &= above > -DIFFER_M or not self.armed
        if self.compares and self.began is not None and None not in (self.receiver, self.receiver_ground):
            self.known &= abs((self.receiver - self.receiver_ground) - above) < DIFFER_M
        if self.armed and self.began is None and (not self.crashes_s or at - self.crashes_s[-1] >= WRECK_S):
            if above > BEGAN_M:
                self.up_since = at if self.up_since is None else self.up_since
                if above > TAKEOFF_M and at - self.up_since >= TAKEOFF_S:
                    self.began, self.low_since = self.up_since, None
            else:
                self.up_since = None
        self.hit(at)
        if above > TAKEOFF_M:
            self.struck = None
        if self.began is not None:
            self.low_since = None if above > LANDED_M else self.low_since if self.low_since is not None else at
            if self.low_since is not None and at - self.low_since >= LANDED_S:
                self.end(self.low_since, landed=True)

    def hit(self, at):
        flew = self.began is not None or self.falling is not None
        if not flew or self.above(at) > HIT_M:
            return
        sink = (self.heights[0][1] - self.heights[-1][1]) / HIT_S
        shocked = at - self.shock < HIT_S and max((speed for _, speed in self.speeds), default=math.inf) > HIT_G_M_S
        if shocked and self.plane and not self.rotors and sink < GEAR_M_S:
            shocked = False
            if self.throttle >= IDLE and self.struck is None:
                self.struck = at
        if sink > (HIT_PLANE_M_S if self.plane else HIT_M_S) or shocked or self.falling is not None:
            self.crashes_s.append(at)
            self.falling = None
            self.end(at, landed=False)

    def end(self, at, landed):
        if self.struck is not None:
            self.crashes_s.append(self.struck)
        if self.began is not None:
            self.flights.append([round(self.began, 2), round(at, 2)])
            self.landings += landed and self.struck is None
        self.began = self.up_since = self.low_since = self.struck = None

    def result(self, at):
        if self.falling is not None:
            self.crashes_s.append(self.falling)
        self.end(at, landed=False)
        known = {"battery_low_s": self.battery_low_s}
        if self.known:
            crashes_s = [round(at, 2) for at in self.crashes_s]
            known |= {"flights": self.flights, "landings": int(self.landings), "crashes_s": crashes_s}
        return known


def main(dialect_path, folder):
    dialect = load_dialect(dialect_path)
    path = os.path.join(folder, "labels.json")
    with open(path) as file:
        labels = json.load(file)
    for label in labels:
        flights, last = Flights(label["class"]), 0.0
        for at, message in messages(dialect, os.path.join(folder, label["file"])):
            flights.take(at, message)
            last = at
        for field in ("flights", "landings", "crash_s", "crashes_s", "battery_low_s"):
            label.pop(field, None)
        label.update(flights.result(last))
    with open(path, "w") as file:
        file.write("[\n" + ",\n".join(json.dumps(label) for label in labels) + "\n]\n")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
