"""An ArduCopter in the air whose battery runs empty, and the ground station of its pilot, both at the box.

usage: autopilot.py DIALECT.py AUTOPILOT_PORT GS_PORT PILOT        prints JSON
  AUTOPILOT_PORT, GS_PORT  the UDP ports at which `hums sim udpin:... --gs udpin:...` listens
  PILOT                    what the pilot does when the action is announced: nothing, cancels, or on_ground: it never flew;
                           two_systems: nothing, and the heartbeat of another vehicle, system 7, is forwarded, first of all

The battery is empty from the fourth second on. The autopilot answers COMMAND_LONG, and does what it says. It prints

  commands  each COMMAND_LONG that the autopilot got: seconds since the battery was empty, command, all else that it says
  texts     each STATUSTEXT of the box that the ground station got: seconds, severity, text
  cancel    the result of the pilot's command, null without one
"""

import json
import os
import socket
import sys
import time

os.environ["MAVLINK20"] = "1"
from manifest import load_dialect

OURS, AUTOPILOT = 191, 1
EMPTY_S, END_S = 3.0, 13.0
ARMED, GUIDED, RTL, LAND = 128, 4, 6, 9
MODES = {20: RTL, 21: LAND}
CANCEL = 31011


class Port:
    """MAVLink over UDP, without waiting."""

    def __init__(self, dialect, port, system, component):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.setblocking(False)
        self.mav = dialect.MAVLink(self, srcSystem=system, srcComponent=component)
        self.mav.robust_parsing = True

    def write(self, data):
        try:
            self.socket.send(data)
        except OSError:
            pass

    def read(self):
        while True:
            try:
                data = self.socket.recv(65536)
            except OSError:
                return
            yield from self.mav.parse_buffer(data) or []


class World:
    def __init__(self, dialect, autopilot_port, gs_port, pilot):
        self.autopilot = Port(dialect, autopilot_port, 1, AUTOPILOT)
        self.station = Port(dialect, gs_port, 255, 190)
        self.other = dialect.MAVLink(self.autopilot, srcSystem=7, srcComponent=AUTOPILOT)
        self.pilot, self.mode = pilot, GUIDED
        self.commands, self.texts, self.cancel, self.beats = [], [], None, 0
        self.start = time.monotonic()

    def now_s(self):
        return time.monotonic() - self.start - EMPTY_S

    def fly(self):
        mav, boot_ms = self.autopilot.mav, int((time.monotonic() - self.start) * 1000)
        if self.pilot == "two_systems" and self.beats % 10 == 0:
            self.other.heartbeat_send(1, 3, 1 | ARMED, 10, 4)
        self.beats += 1
        flies = self.pilot != "on_ground" and boot_ms > 1000
        mav.heartbeat_send(2, 3, 1 | (ARMED if flies else 0), self.mode, 4)
        height_mm = 20_000 if flies and boot_ms > 1500 else 0
        mav.global_position_int_send(boot_ms, 0, 0, 500_000, height_mm, 0, 0, 0, 0)
        remaining = 5 if self.now_s() >= 0 else 80
        mav.battery_status_send(0, 0, 1, 32767, [15_000] + [65535] * 9, 2_000, 100, -1, remaining)

    def take_command(self, message):
        self.commands.append({
            "s": round(self.now_s(), 2),
            "command": message.command,
            "target": [message.target_system, message.target_component],
            "confirmation": message.confirmation,
            "params": [getattr(message, f"param{number}") for number in range(1, 8)],
        })
        self.mode = MODES.get(message.command, self.mode)
        self.autopilot.mav.command_ack_send(message.command, 0, 0, 0, 1, OURS)

    def step(self):
        for message in self.autopilot.read():
            if message.get_type() == "COMMAND_LONG" and message.command in MODES:
                self.take_command(message)
        for message in self.station.read():
            if message.get_srcComponent() != OURS:
                continue
            if message.get_type() == "STATUSTEXT":
                self.texts.append([round(self.now_s(), 2), message.severity, message.text])
                if self.pilot == "cancels" and "change mode to cancel" in message.text:
                    self.station.mav.command_long_send(1, OURS, CANCEL, 0, 0, 0, 0, 0, 0, 0, 0)
            elif message.get_type() == "COMMAND_ACK" and message.command == CANCEL:
                self.cancel = message.result

    def run(self):
        next_s = -EMPTY_S
        while self.now_s() < END_S - EMPTY_S:
            if self.now_s() >= next_s:
                next_s += 0.1
                self.fly()
                if int(next_s * 10) % 10 == 0:
                    self.station.mav.heartbeat_send(6, 8, 0, 0, 4)
            self.step()
            time.sleep(0.01)
        return {"commands": self.commands, "texts": self.texts, "cancel": self.cancel}


def main():
    dialect = load_dialect(sys.argv[1])
    print(json.dumps(World(dialect, int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]).run()))


if __name__ == "__main__":
    main()
