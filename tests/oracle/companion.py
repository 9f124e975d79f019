"""Talks to the box like a ground station, with pymavlink, and prints the results.

usage: companion.py DIALECT.py PORT        prints JSON
  PORT  the UDP port at which `hums sim --gs udpin:127.0.0.1:PORT` listens

A step without an answer in time is null, so that the caller reports the missing one.
"""

import json
import os
import sys
import time

os.environ["MAVLINK20"] = "1"
from manifest import load_dialect

OURS = 191


class Peer:
    def __init__(self, dialect, port):
        from pymavlink import mavutil

        self.dialect = dialect
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255, source_component=190)
        self.link.mav = dialect.MAVLink(self.link, srcSystem=255, srcComponent=190)
        self.link.mav.robust_parsing = True
        self.mav = self.link.mav
        self.count = 0

    def beat(self):
        self.mav.heartbeat_send(6, 8, 0, 0, 4)

    def messages(self, seconds):
        end = time.time() + seconds
        self.link.port.settimeout(0.1)
        while time.time() < end:
            try:
                data = self.link.port.recv(65536)
            except (TimeoutError, OSError):
                continue
            for message in self.mav.parse_buffer(data) or []:
                self.count += 1
                if message.get_srcComponent() == OURS:
                    yield message

    def ask(self, send, wanted, seconds=3.0, tries=4):
        for _ in range(tries):
            send()
            for message in self.messages(seconds / tries):
                if wanted(message):
                    return message
        return None

    def param(self, name):
        return lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name

    def ack(self, command):
        return lambda m: m.get_type() == "COMMAND_ACK" and m.command == command

    def command(self, command, *params):
        params = list(params) + [0] * (7 - len(params))
        return self.ask(
            lambda: self.mav.command_long_send(1, OURS, command, 0, *params), self.ack(command)
        )


def listing(peer, component, seconds=20):
    values, count = {}, None
    peer.mav.param_request_list_send(1, component)
    for message in peer.messages(seconds):
        if message.get_type() == "PARAM_VALUE":
            values[message.param_index] = (message.param_id, message.param_value)
            count = message.param_count
            if len(values) == count:
                break
    return values, count


def value(message):
    return None if message is None else round(message.param_value, 4)


def result(message):
    return None if message is None else message.result


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    dialect = load_dialect(sys.argv[1])
    peer = Peer(dialect, sys.argv[2])
    mav = peer.mav
    out = {}

    beats = lambda m: m.get_type() == "HEARTBEAT"
    ours = peer.ask(peer.beat, beats, 10, 10)
    out["heartbeat"] = None if ours is None else [ours.get_srcSystem(), ours.type, ours.autopilot]

    values, count = listing(peer, 0)
    out["listed"], out["count"] = len(values), count
    out["names"] = sorted(name for name, _ in values.values())
    values, count = listing(peer, OURS)
    out["listed_again"] = len(values)

    def read(name):
        return peer.ask(lambda: mav.param_request_read_send(1, OURS, name.encode(), -1), peer.param(name))

    def put(name, number, kind=9):
        return peer.ask(lambda: mav.param_set_send(1, OURS, name.encode(), number, kind), peer.param(name))

    out["read"] = value(read("GS_BUDGET"))
    at = peer.ask(lambda: mav.param_request_read_send(1, 0, b"", 0), lambda m: m.get_type() == "PARAM_VALUE")
    out["read_at_0"] = None if at is None else at.param_index
    out["set"] = value(put("BAT_REM_WARN", 22.0))
    out["set_as_integer"] = value(put("BAT_REM_CRIT", 9.0, 6))
    out["refused"] = value(put("BAT_REM_WARN", 1000.0))
    out["refused_nan"] = value(put("BAT_REM_WARN", float("nan")))
    out["after"] = value(read("BAT_REM_WARN"))

    out["unsupported"] = result(peer.command(2000))
    out["version_ack"] = result(peer.command(512, 148))
    version = peer.ask(
        lambda: mav.command_long_send(1, OURS, 512, 0, 148, 0, 0, 0, 0, 0, 0),
        lambda m: m.get_type() == "AUTOPILOT_VERSION",
    )
    out["capabilities"] = None if version is None else version.capabilities
    protocol = peer.ask(
        lambda: mav.command_int_send(1, OURS, 0, 512, 0, 0, 300, 0, 0, 0, 0, 0, 0),
        lambda m: m.get_type() == "PROTOCOL_VERSION",
    )
    out["protocol"] = None if protocol is None else protocol.version
    out["preflight"] = result(peer.command(401))
    out["stop"] = result(peer.command(2511))
    out["record"] = result(peer.command(2510))
    # 31010: a component was replaced; 31011: cancel the protective action.
    out["no_component"] = result(peer.command(31010, 1))
    put("CMP1_KIND", 4.0)
    # In force at the next tick, 50 ms later.
    time.sleep(0.5)
    out["replaced"] = result(peer.command(31010, 1))
    out["nothing_to_cancel"] = result(peer.command(31011))
    out["for_the_autopilot"] = result(
        peer.ask(lambda: mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0), peer.ack(400), 1.0, 2)
    )
    print(json.dumps(out))


if __name__ == "__main__":
    main()
