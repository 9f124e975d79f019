"""Plays the autopilot at one port of the box and the ground station at the other, with pymavlink, and prints what came.

usage: vehicle.py DIALECT.py AUTOPILOT_PORT GS_PORT KIND        prints JSON
  AUTOPILOT_PORT  where `hums sim udpin:127.0.0.1:PORT` listens
  GS_PORT         where its `--gs udpin:127.0.0.1:PORT` does; its GS_PASS is 1
  KIND            px4: takes SET_MESSAGE_INTERVAL, and refuses what it does not know
                  ardupilot: knows no SET_MESSAGE_INTERVAL, as versions before 4.0
"""

import json
import os
import sys
import time

os.environ["MAVLINK20"] = "1"
from companion import OURS, load_dialect

# GLOBAL_POSITION_INT, VFR_HUD, BATTERY_STATUS, EXTENDED_SYS_STATE: those of a flight.
TOLD_IN_FLIGHT = {33, 74, 147, 245}
# What a PX4 of the test can send; anything else is refused for good.
PX4_HAS = {1, 2, 24, 30, 33, 65, 74, 105, 147, 230, 241, 245, 290, 291, 32}


class End:
    """One end of a line: what is sent, and what came, frame by frame."""

    def __init__(self, dialect, port, system, component):
        from pymavlink import mavutil

        self.link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=system, source_component=component
        )
        self.mav = self.link.mav = dialect.MAVLink(self.link, srcSystem=system, srcComponent=component)
        self.mav.robust_parsing = True
        self.heard = []

    def poll(self):
        self.link.port.settimeout(0.002)
        new = []
        while True:
            try:
                data = self.link.port.recv(65536)
            except (TimeoutError, OSError):
                break
            new += self.mav.parse_buffer(data) or []
        self.heard += [bytes(message.get_msgbuf()) for message in new]
        return new


class Vehicle:
    def __init__(self, dialect, ports, kind):
        self.dialect = dialect
        self.kind = kind
        self.autopilot = End(dialect, ports[0], 1, 1)
        self.ground = End(dialect, ports[1], 255, 190)
        self.begun = self.boot = time.time()
        self.beat_at = 0
        self.intervals, self.last = {}, {}
        self.asked, self.groups, self.version = [], [], 0
        self.flies, self.returns = False, []

    def frame(self, message, system=1, component=1, key=None):
        """A frame as somebody else would send it, signed where there is a key."""
        mav = self.dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        if key is not None:
            mav.signing.secret_key, mav.signing.sign_outgoing = key, True
            mav.signing.link_id, mav.signing.timestamp = 9, 12345678
        return bytes(message.pack(mav))

    def run(self, seconds, until=lambda: False):
        end = time.time() + seconds
        while time.time() < end and not until():
            now = time.time()
            boot_ms = int((now - self.boot) * 1000)
            mav = self.autopilot.mav
            if now - self.beat_at >= 0.5:
                self.beat_at = now
                # MAV_MODE_FLAG_SAFETY_ARMED
                mav.heartbeat_send(2, 12 if self.kind == "px4" else 3, 128 if self.flies else 0, 0, 4 if self.flies else 3)
                if self.flies:
                    # MAV_LANDED_STATE_IN_AIR, and a battery that is as good as empty.
                    mav.extended_sys_state_send(0, 2)
                    mav.global_position_int_send(boot_ms, 0, 0, 90000, 30000, 0, 0, 0, 0)
                    mav.vfr_hud_send(5, 5, 0, 50, 30, 0)
                    mav.battery_status_send(0, 0, 3, 2500, [3700] * 3 + [65535] * 7, 1000, 100, -1, 2)
                mav.system_time_send(0, boot_ms)
                self.ground.mav.heartbeat_send(6, 8, 0, 0, 4)
            for number, interval in self.intervals.items():
                # Said above: zeros beside it would put it on the ground again, with another battery.
                told = self.flies and number in TOLD_IN_FLIGHT
                if interval > 0 and not told and now - self.last.get(number, 0) >= interval:
                    self.last[number] = now
                    self.stream(number, boot_ms)
            for message in self.autopilot.poll():
                self.take(message)
            self.ground.poll()
            time.sleep(0.005)

    def stream(self, number, boot_ms):
        # The content does not matter here: what is asked for is that it comes.
        mav = self.autopilot.mav
        if number == 30:
            mav.attitude_send(boot_ms, 0, 0, 0, 0, 0, 0)
        elif number == 1:
            mav.sys_status_send(0, 0, 0, 100, 12000, 100, 50, 0, 0, 0, 0, 0, 0)
        elif number in PX4_HAS:
            self.autopilot.link.write(self.zeros(number))

    def zeros(self, number):
        kind = self.dialect.mavlink_map[number]
        counts = [kind.array_lengths[at] for at in kind.orders]
        fields = [
            b"" if field == "char" else [0] * count if count else 0 for field, count in zip(kind.fieldtypes, counts)
        ]
        return bytes(kind(*fields).pack(self.autopilot.mav))

    def take(self, message):
        if message.get_srcComponent() != OURS:
            return
        name, mav = message.get_type(), self.autopilot.mav
        if name == "COMMAND_LONG" and message.command == 511:
            number = int(message.param1)
            self.asked.append([round(time.time() - self.begun, 2), number])
            known = self.kind == "px4" and number in PX4_HAS
            # MAV_RESULT: 0 accepted, 3 unsupported.
            mav.command_ack_send(511, 0 if known else 3, 0, 0, 1, OURS)
            if known:
                self.intervals[number] = message.param2 / 1e6
        elif name == "COMMAND_LONG" and message.command == 512 and int(message.param1) == 148:
            self.version += 1
            mav.command_ack_send(512, 0, 0, 0, 1, OURS)
            mav.autopilot_version_send(0, 0x01020304, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 7)
        elif name == "COMMAND_LONG" and message.command == 20:
            self.returns.append([message.target_system, message.target_component, message.confirmation])
            mav.command_ack_send(20, 0, 0, 0, 1, OURS)
        elif name == "REQUEST_DATA_STREAM":
            self.groups.append([message.req_stream_id, message.req_message_rate, message.start_stop])


def asking(vehicle, out):
    """What it asks for, that it stops, and that it asks again after a reboot."""
    vehicle.run(14)
    out["asked"] = sorted({number for _, number in vehicle.asked})
    out["first_asked_s"] = vehicle.asked[0][0] if vehicle.asked else None
    out["times_asked"] = max((sum(1 for _, n in vehicle.asked if n == number) for number in out["asked"]), default=0)
    out["groups"] = sorted({group for group, _, _ in vehicle.groups})
    out["version_asked"] = vehicle.version
    before = len(vehicle.asked) + len(vehicle.groups)
    # It reboots: what was asked is forgotten, and its time falls.
    vehicle.intervals.clear()
    vehicle.boot = time.time()
    vehicle.run(13)
    out["asked_again"] = len(vehicle.asked) + len(vehicle.groups) - before


def passing(vehicle, out):
    """What passes through the box, and what does not."""
    d = vehicle.dialect
    key = bytes(range(32))
    up = {
        "command": vehicle.frame(d.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0), 255, 190),
        "signed": vehicle.frame(d.MAVLink_param_request_list_message(1, 1), 255, 190, key),
        "heartbeat": vehicle.frame(d.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), 250, 191),
        "broadcast": vehicle.frame(d.MAVLink_param_request_list_message(0, 0), 255, 190),
    }
    stays_up = {
        "ours": vehicle.frame(d.MAVLink_param_request_read_message(1, OURS, b"GS_BUDGET", -1), 255, 190),
        "key": vehicle.frame(d.MAVLink_setup_signing_message(1, 1, key, 5), 255, 190),
        "radio": vehicle.frame(d.MAVLink_radio_status_message(100, 100, 50, 9, 9, 0, 0), 51, 68),
        "forged": vehicle.frame(d.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3), 1, 1),
    }
    down = {
        "param": vehicle.frame(d.MAVLink_param_value_message(b"ARMING_CHECK", 1, 9, 900, 3)),
        "mission": vehicle.frame(d.MAVLink_mission_request_int_message(255, 190, 3)),
        "signed": vehicle.frame(d.MAVLink_param_value_message(b"SIGNED", 1, 9, 900, 4), key=key),
        "gimbal": vehicle.frame(d.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3), 1, 154),
    }
    stays_down = {
        "stream": vehicle.frame(d.MAVLink_attitude_quaternion_message(5, 1, 0, 0, 0, 0, 0, 0)),
        "key": vehicle.frame(d.MAVLink_setup_signing_message(255, 190, key, 5)),
        "to_us": vehicle.frame(d.MAVLink_param_request_list_message(1, OURS), 1, 1),
    }

    def through(frames, source, sink, tries):
        came = {}
        for name, frame in frames.items():
            for _ in range(tries):
                source.link.write(frame)
                vehicle.run(0.3, lambda: frame in sink.heard)
                if frame in sink.heard:
                    break
            came[name] = frame in sink.heard
        return came

    ground, autopilot = vehicle.ground, vehicle.autopilot
    out["up"] = through(up, ground, autopilot, 5)
    out["stays_up"] = through(stays_up, ground, autopilot, 2)
    out["down"] = through(down, autopilot, ground, 5)
    out["stays_down"] = through(stays_down, autopilot, ground, 2)


def erasing(vehicle, out):
    """The logs before and after they are erased, on the ground."""

    def logs():
        entries = {}
        for _ in range(4):
            vehicle.ground.mav.log_request_list_send(1, OURS, 0, 0xFFFF)
            end = time.time() + 1.5
            while time.time() < end:
                vehicle.run(0.02)
                for frame in vehicle.ground.heard:
                    if frame[7] == 118 and frame[6] == OURS:
                        message = vehicle.dialect.MAVLink(None).decode(bytearray(frame))
                        entries[message.id] = [message.size, message.num_logs]
                vehicle.ground.heard.clear()
            if entries:
                return sorted(entries.values())
        return None

    out["logs_before"] = logs()
    vehicle.ground.mav.log_erase_send(1, OURS)
    vehicle.run(1.0)
    out["logs_after"] = logs()


def protecting(vehicle, out):
    """In flight with an empty battery it asks to return, unless somebody cancels that."""
    ground = vehicle.ground

    def heard(wanted, seconds):
        def seen():
            return any(wanted(frame) for frame in ground.heard)

        vehicle.run(seconds, seen)
        return seen()

    def told(text, seconds):
        return heard(lambda frame: frame[7] == 253 and text.encode() in frame, seconds)

    for name, value in ((b"PROT_ACTION", 1.0), (b"PROT_DELAY", 6.0)):
        for _ in range(5):
            ground.heard.clear()
            ground.mav.param_set_send(1, OURS, name, value, 9)
            if heard(lambda frame, name=name: frame[7] == 22 and name in frame, 2):
                break
    for flight in ("cancelled", "asked_for"):
        ground.heard.clear()
        vehicle.flies = True
        announced = told("return in 6 s", 60)
        if flight == "cancelled":
            ground.mav.command_long_send(1, OURS, 31011, 0, 0, 0, 0, 0, 0, 0, 0)
            told("cancelled by command", 5)
        accepted = told("return accepted", 9 if flight == "cancelled" else 30)
        out[flight] = [announced, told("cancelled by command", 0.1), accepted, vehicle.returns[:]]
        # On the ground again, disarmed: the next flight is another one.
        vehicle.flies = False
        vehicle.autopilot.mav.extended_sys_state_send(0, 1)
        vehicle.run(8)


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    vehicle = Vehicle(load_dialect(sys.argv[1]), sys.argv[2:4], sys.argv[4])
    out = {}
    asking(vehicle, out)
    passing(vehicle, out)
    erasing(vehicle, out)
    if sys.argv[4] == "px4":
        protecting(vehicle, out)
    print(json.dumps(out))


if __name__ == "__main__":
    main()
