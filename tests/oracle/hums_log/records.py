"""Section 9: records."""

import math
import struct

MOMENTS = ["start", "periodic", "end"]
LEVELS = ["ok", "advisory", "warning", "critical", "stale"]
SUBSYSTEMS = ["power", "propulsion", "engine", "structure", "navigation", "link", "computer", "attitude",
              "recorder"]
LOSSES = ["uart_overrun", "bytes_not_frames", "damaged_frames", "queue_full", "card", "records"]
EVENTS = ["", "armed", "disarmed", "take_off", "landing", "snapshot", "card_in", "card_out", "critical", "phase",
          "autopilot_reboot", "other_airframe"]
SOURCES = ["unknown", "SYSTEM_TIME", "recording", "GNSS"]
FAULTS = ["unknown", "panic", "hard_fault", "watchdog"]
STATISTICS = ["frames_in", "frames_logged", "frames_lost", "bytes_in", "bytes_not_frames", "bytes_logged",
              "blocks_written", "queue_bytes_max", "queue_bytes_capacity", "sd_stall_ms_max", "gs_frames",
              "gs_bytes", "frame_queue_bytes_max", "frame_queue_bytes_capacity", "gs_queue_bytes_max",
              "gs_queue_bytes_capacity", "cpu_permille", "cpu_permille_max", "stack_bytes_max",
              "stack_bytes_capacity"]
# Fields with their types: those of the module struct, `text`, `time` (in seconds), so many bytes, or a list of names.
RECORDS = {
    1: ("HUMS_BOOT", {"version": "text", "git": "text", "board": "text", "reset": "I", "reset_name": "text", "uid": 12,
                      "boots": "I"}),
    2: ("HUMS_VEHICLE", {"system": "B", "component": "B", "autopilot": "B", "type": "B", "firmware": "I", "uid": "Q"}),
    3: ("HUMS_PARAM", {"name": "text", "value": "d", "changed": "?", "by_system": "B", "by_component": "B"}),
    4: ("HUMS_CLOCK", {"boot[s]": "time", "utc[us]": "Q", "source": SOURCES}),
    5: ("HUMS_FINDING", {"at[s]": "time", "subsystem": SUBSYSTEMS, "check": "text", "instance": "B", "level": LEVELS,
                         "previous": LEVELS, "value": "f", "limit": "f", "unit": "text"}),
    7: ("HUMS_LOSS", {"what": LOSSES, "count": "Q", "from[s]": "time", "to[s]": "time"}),
    8: ("HUMS_STATS", {name: "Q" for name in STATISTICS}),
    9: ("HUMS_FAULT", {"kind": FAULTS, "task": "text", "place": "text", "registers": 48, "message": "text"}),
    10: ("HUMS_EVENT", {"event": EVENTS, "text": "text"}),
    11: ("HUMS_NOTE", {"severity": "B", "text": "text"}),
    15: ("HUMS_KEEP", {"all": "B", "from_sector": "I", "seconds": "I"}),
}


class Fields:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, size):
        taken = self.data[self.at:self.at + size].ljust(size, b"\0")
        self.at += size
        return taken

    def field(self, kind):
        if kind == "text":
            return self.take(self.take(1)[0]).rstrip(b"\0").decode("utf-8", "replace")
        if kind == "time":
            return self.field("Q") / 1e6
        if isinstance(kind, int):
            return self.take(kind).hex()
        if isinstance(kind, list):
            number = self.field("B")
            return kind[number] if number < len(kind) else "unknown"
        value = struct.unpack("<" + kind, self.take(struct.calcsize(kind)))[0]
        return None if isinstance(value, float) and not math.isfinite(value) else value


def counters(fields):
    """What usage and lifetime have in common: one row a counter, which is said by its number."""
    for _ in range(fields.field("B")):
        number, is_count = fields.field("B"), fields.field("B")
        yield {"counter": number, "value": fields.field("Q" if is_count else "d")}


def rows_of(record):
    """A record as `hums decode` shows it: its name and the fields, in as many rows."""
    fields = Fields(record)
    kind, _version = fields.field("B"), fields.field("B")
    if kind in RECORDS:
        name, kinds = RECORDS[kind]
        return [(name, {field: fields.field(what) for field, what in kinds.items()})]
    if kind == 6:
        moment = fields.field(MOMENTS)
        return [("HUMS_USAGE", {"moment": moment, **row}) for row in counters(fields)]
    return [("HUMS_OTHER", {"kind": kind, "bytes": record[2:].hex()})]
