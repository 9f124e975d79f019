"""Section 9: coding and fields of records."""

import math
import struct

from arithmetic import M32
from coder import Distribution

MOMENTS = ["start", "periodic", "end"]
LEVELS = ["ok", "advisory", "warning", "critical", "stale"]
SUBSYSTEMS = ["power", "propulsion", "engine", "structure", "navigation", "link", "computer", "attitude",
              "recorder", "mishap"]
LOSSES = ["uart_overrun", "bytes_not_frames", "damaged_frames", "queue_full", "card", "records", "wrong_checksums", "damaged_places"]
EVENTS = ["", "armed", "disarmed", "take_off", "landing", "snapshot", "card_in", "card_out", "critical", "phase",
          "autopilot_reboot", "other_airframe", "by_link", "other_vehicle", "flight_resumed",
          "mishap", "mishap_down", "mishap_over", "mishap_on_bench"]
SOURCES = ["unknown", "SYSTEM_TIME", "recording", "GNSS"]
FAULTS = ["unknown", "panic", "hard_fault", "watchdog"]
FOUND = ["unknown", "nothing", "sectors", "frames", "unreadable"]
RESTING = ["unknown", "disarmed", "landed", "mishap"]
STATISTICS = ["frames_in", "frames_logged", "frames_lost", "bytes_in", "bytes_not_frames", "bytes_logged",
              "blocks_written", "queue_bytes_max", "queue_bytes_capacity", "sd_stall_ms_max", "gs_frames",
              "gs_bytes", "frame_queue_bytes_max", "frame_queue_bytes_capacity", "gs_queue_bytes_max",
              "gs_queue_bytes_capacity", "cpu_permille", "cpu_permille_max", "stack_bytes_max",
              "stack_bytes_capacity", "gs_frames_lost", "autopilot_frames_lost", "passed_frames_lost",
              "requests_refused"]
# Fields with their types: those of the module struct, `text`, `time` (in seconds), a number of bytes (negative: of words),
# or a list of names.
RECORDS = {
    1: ("HUMS_BOOT", {"version": "text", "git": "text", "board": "text", "reset": "I", "reset_name": "text", "uid": 12,
                      "boots": "I", "before_number": "I", "before_session": "I", "before_sectors": "I",
                      "before_frames": "I", "before_check": "I", "before": FOUND}),
    2: ("HUMS_VEHICLE", {"system": "B", "component": "B", "autopilot": "B", "type": "B", "firmware": "I", "uid": "Q"}),
    3: ("HUMS_PARAM", {"name": "text", "value": "d", "changed": "?", "by_system": "B", "by_component": "B"}),
    4: ("HUMS_CLOCK", {"boot[s]": "time", "utc[us]": "Q", "source": SOURCES}),
    5: ("HUMS_FINDING", {"at[s]": "time", "subsystem": SUBSYSTEMS, "check": "text", "instance": "B", "level": LEVELS,
                         "previous": LEVELS, "value": "f", "limit": "f", "unit": "text"}),
    7: ("HUMS_LOSS", {"what": LOSSES, "from[s]": "time", "to[s]": "time", "count": "Q"}),
    8: ("HUMS_STATS", {name: "Q" for name in STATISTICS}),
    9: ("HUMS_FAULT", {"kind": FAULTS, "task": "text", "place": "text", "registers": -48, "message": "text"}),
    10: ("HUMS_EVENT", {"event": EVENTS, "text": "text"}),
    11: ("HUMS_NOTE", {"severity": "B", "text": "text"}),
    18: ("HUMS_MARK", {"why": RESTING, "sector": "I", "frames": "I"}),
}


class Records:
    """The state of a group's records."""

    def __init__(self, coder, model):
        self.coder, self.model = coder, model
        self.kinds, self.last = Distribution(), {}
        self.words = [Distribution() for _ in range(16)]
        self.halves = [Distribution() for _ in range(4)]

    def read(self, now_ms):
        """A record in its stored form."""
        bits = self.coder.bits
        kind = self.coder.symbol(self.kinds)
        if kind == 0:
            return bytes(bits(8) for _ in range(bits(10)))
        kind = bits(8) if kind == 15 else kind
        head = self.number(kind, 0)
        version, words, halves = head & 255, head >> 8 & 255, head >> 16 & 255
        length = self.number(kind, 1)
        stored = bytearray([kind, version, words, halves])
        now = [now_ms * 1000 & M32, now_ms * 1000 >> 32 & M32]
        for i in range(words):
            number = self.number(kind, i + 2, now[i & 1] if i < 2 * (version >> 4) else None)
            stored += number.to_bytes(4, "little")
        c = 0
        for _ in range(halves):
            c = self.coder.symbol(self.halves[(c > 0) + (c > 4) + (c > 8)])
            stored += (self.difference(c) & 0xFFFF).to_bytes(2, "little")
        return bytes(stored) + self.model.text(length)

    def number(self, kind, i, guess=None):
        guess = self.last.get((kind & 15, i), 0) if guess is None else guess
        c = self.coder.symbol(self.words[5 * (kind & 15) + i & 15])
        number = guess + self.difference(c) & M32
        if i < 26:
            self.last[kind & 15, i] = number
        return number

    def difference(self, c):
        c += self.coder.bits(5) if c == 15 else 0
        return self.coder.magnitude(c) if c else 0


class Fields:
    """Words and bytes of a record, each in their order."""

    def __init__(self, stored):
        words_end = 4 + 4 * stored[2]
        self.words, self.data = stored[4:words_end], stored[words_end + 2 * stored[3]:]

    def take(self, size):
        taken, self.data = self.data[:size].ljust(size, b"\0"), self.data[size:]
        return taken

    def take_words(self, size):
        taken, self.words = self.words[:size].ljust(size, b"\0"), self.words[size:]
        return taken

    def field(self, kind):
        if kind == "text":
            return self.take(self.take(1)[0]).rstrip(b"\0").decode("utf-8", "replace")
        if kind == "time":
            return self.field("Q") / 1e6
        if isinstance(kind, int):
            return (self.take_words(-kind) if kind < 0 else self.take(kind)).hex()
        if isinstance(kind, list):
            number = self.field("B")
            return kind[number] if number < len(kind) else "unknown"
        size = struct.calcsize(kind)
        value = struct.unpack("<" + kind, self.take(size) if size == 1 else self.take_words(size))[0]
        return None if isinstance(value, float) and not math.isfinite(value) else value


def counters(fields):
    """The end of usage and lifetime: one row a counter, in runs of counter numbers."""
    while fields.data:
        first, count = fields.take(2)
        for number in range(first, first + count):
            yield {"counter": number, "value": fields.field("f")}


def rows_of(record):
    """The rows of a record in `hums decode`: its name and the fields."""
    kind, fields = record[0], Fields(record)
    if kind in RECORDS:
        name, kinds = RECORDS[kind]
        return [(name, {field: fields.field(what) for field, what in kinds.items()})]
    if kind == 6:
        moment = fields.field(MOMENTS)
        return [("HUMS_USAGE", {"moment": moment, **row}) for row in counters(fields)]
    return [("HUMS_OTHER", {"kind": kind, "bytes": record[2:].hex()})]
