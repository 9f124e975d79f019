"""Reads the output of `hums decode` with foreign readers, and compares every field of every message with pymavlink's
reading of the recording itself.

usage: readback.py DIALECT.py RECORDING OUT INFLUXD        prints JSON

OUT is the folder of one log, decoded as csv, jsonl, influx and parquet. The readers are Python's csv and json, pyarrow,
and InfluxDB (INFLUXD is the program), which takes every point of the line protocol and returns them.
Numbers must equal pymavlink's: each format prints digits that read back as the same number. Times are compared with
those before the frames of a tlog: seconds since the first one, to the millisecond, and UTC, which is the first one's
plus these seconds. A raw recording has no times. Its frames have those of the autopilot's messages, to a tenth of a second;
before the first of these they come as on a line at 115,200 baud, up to 32 bytes together. UTC is that of SYSTEM_TIME, to a tenth of a second.
"""

import collections
import csv
import datetime
import glob
import json
import math
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request

import pyarrow.parquet

from manifest import Reader, frame_at, is_tlog, load_dialect

csv.field_size_limit(1 << 24)


SECOND_US, DAY_US = 1_000_000, 86_400_000_000
# Bytes a second of a raw recording, and the delay of a frame after its last byte; its delay after the autopilot's latest
# time, once there is one, and the messages with that time: SYSTEM_TIME, ATTITUDE, GLOBAL_POSITION_INT.
RAW_BYTES_S, RAW_LATE_US = 11_520, 32 * SECOND_US // 11_520
TOLD_LATE_US, TELLING, AUTOPILOT = 100_000, (2, 30, 33), 1
EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)


class Arrival:
    """Arrival times, in microseconds since the first one. A PC's clock may be set while it records: after a step back of
    more than a second, or forward of more than a day, time continues from before; it never falls."""

    def __init__(self):
        self.first = self.last = None
        self.at = 0
        self.late = 0
        # For a raw recording: the source of the time, its first time, and its arrival.
        self.teller = None
        # UTC of the first frame, by SYSTEM_TIME.
        self.told = None

    def byte(self, place, message):
        """For a raw recording: the number of bytes so far, and the message of the last one."""
        system = message.get_srcSystem()
        tells = message.get_msgId() in TELLING and message.get_srcComponent() == AUTOPILOT
        if self.teller is None:
            self.at, self.late = place * SECOND_US // RAW_BYTES_S, RAW_LATE_US
            if tells:
                self.teller = system, message.time_boot_ms, self.at
        elif tells and system == self.teller[0]:
            _, first_ms, base = self.teller
            self.at = max(self.at, base + (message.time_boot_ms - first_ms) * 1000)
            self.late = TOLD_LATE_US
            if self.told is None and message.get_msgId() == 2 and message.time_unix_usec > 0:
                self.told = message.time_unix_usec - self.at

    def entry(self, time_us):
        if self.first is None:
            self.first = self.last = time_us
        step = time_us - self.last
        if -SECOND_US <= step < 0:
            return
        if 0 <= step <= DAY_US:
            self.at += step
        self.last = time_us


def messages_of(data, dialect, arrival):
    """Each verified message in order; `arrival` has its time."""
    reader, at, tlog = Reader(dialect), 0, is_tlog(data)
    skip = 8 if tlog else 0
    while at + skip < len(data):
        found = frame_at(data, at + skip)
        if found is None:
            at += 1
            continue
        length, message_id = found
        frame = data[at + skip:at + skip + length]
        if tlog:
            arrival.entry(int.from_bytes(data[at:at + 8], "big"))
        if message_id in dialect.mavlink_map:
            try:
                message = reader.mav.decode(bytearray(frame))
            except dialect.MAVError:
                message = None
            if message is not None and message.get_msgId() == message_id:
                if not tlog:
                    arrival.byte(at + length, message)
                yield message
                at += skip + length
                continue
        at += skip + length if tlog else 1


def fields_of(message):
    """Field names with values: a number, a list of numbers, or text up to its first NUL."""
    fields = {}
    for name, kind in zip(message.fieldnames, message.fieldtypes):
        value = getattr(message, name)
        if kind == "char":
            raw = getattr(message, f"_{name}_raw", value)
            raw = raw.encode("latin-1") if isinstance(raw, str) else bytes(raw)
            value = raw.split(b"\0", 1)[0].decode("utf-8", "replace")
        elif isinstance(value, (list, tuple)):
            value = list(value)
        fields[name] = (kind, value)
    return fields


def same_number(kind, expected, found):
    if found is None:
        return False
    if kind == "float":
        if math.isnan(expected):
            return math.isnan(found)
        return struct.pack("f", found) == struct.pack("f", expected) or found == expected
    if kind == "double":
        return found == expected or (math.isnan(expected) and math.isnan(found))
    return found == expected


class Comparison:
    """Counts comparisons, and stores the first differences."""

    def __init__(self, arrival):
        """`first_us` is UTC of the first frame, in microseconds since 1970; None if nothing says it."""
        self.first_us, self.late = arrival.first, arrival.late
        self.utc_late = 0
        if self.first_us is None and arrival.told is not None:
            self.first_us, self.utc_late = arrival.told, TOLD_LATE_US
        self.values = collections.Counter()
        self.times = collections.Counter()
        self.differences = []

    def check(self, form, where, kind, expected, found):
        self.values[form] += 1
        same = found == expected if kind == "char" else same_number(kind, expected, found)
        if not same and len(self.differences) < 20:
            self.differences.append(f"{form} {where}: {expected!r} became {found!r}")

    def field(self, form, where, kind, expected, get):
        """`get(index)` is the value found; the index is None unless it is an array."""
        if isinstance(expected, list):
            for index, element in enumerate(expected):
                self.check(form, f"{where}[{index}]", kind, element, get(index))
        else:
            self.check(form, where, kind, expected, get(None))

    def time(self, form, name, message, boot_s, utc_us):
        """Both times of a message: seconds since the first frame, and UTC in microseconds or None."""
        self.times[form] += 1
        boot_us = round(float(boot_s) * SECOND_US)
        expected = None if self.first_us is None else self.first_us + boot_us
        is_utc = utc_us == expected or (None not in (utc_us, expected) and abs(utc_us - expected) < self.utc_late)
        in_order = boot_us % 1000 == 0 and self.in_time(boot_us - message["at"]) and is_utc
        if not in_order and len(self.differences) < 20:
            self.differences.append(
                f"{form} {name}: came {message['at']} us after {self.first_us}, became {boot_s} s, {utc_us}")

    def in_time(self, late_us):
        """Within the millisecond of times, or within the delay of bytes that arrive together."""
        return -1000 < late_us < 1000 + self.late

    def point_time(self, name, message, ns):
        """The time of a point: UTC, or the time since the first frame; points of one millisecond are moved apart."""
        self.times["influx"] += 1
        came = (self.first_us or 0) + message["at"]
        in_time = -self.utc_late < ns / 1000 - came < self.utc_late or self.in_time(ns / 1000 - came)
        if not in_time and len(self.differences) < 20:
            self.differences.append(f"influx {name}: came at {came} us, became {ns} ns")

    def equal(self, what, expected, found):
        if expected != found and len(self.differences) < 20:
            self.differences.append(f"{what}: {expected!r} became {found!r}")


def micros_of(text):
    """UTC as text, in microseconds since 1970; None if there is none."""
    if not text:
        return None
    return (datetime.datetime.fromisoformat(text.replace("Z", "+00:00")) - EPOCH) // datetime.timedelta(microseconds=1)


def text_of(cell):
    """A cell of text as sent: one that a spreadsheet would execute has an apostrophe before it (docs/decode.md)."""
    return cell[1:] if cell.startswith("'") else cell


def number(kind, text):
    return float(text) if kind in ("float", "double") else int(text)


def columns_of(header):
    """Column by field and index; the units after the name are for people."""
    columns = {}
    for place, name in enumerate(header[4:], 4):
        found = re.match(r"^(\w+)(?:\[(\d+)\](?=$|\[))?", name)
        columns[found.group(1), None if found.group(2) is None else int(found.group(2))] = place
    return columns


def compare_csv(out, expected, comparison):
    for name, messages in expected.items():
        with open(os.path.join(out["tables"], f"{name}.csv"), newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            columns = columns_of(next(rows))
            count = 0
            for row, message in zip(rows, messages):
                count += 1
                comparison.equal(f"csv {name} sender", message["sender"], (int(row[2]), int(row[3])))
                comparison.time("csv", name, message, row[0], micros_of(row[1]))
                for field, (kind, value) in message["fields"].items():
                    def get(index, field=field, kind=kind, row=row):
                        text = row[columns[field, index]]
                        return text_of(text) if kind == "char" else number(kind, text)
                    comparison.field("csv", f"{name}.{field}", kind, value, get)
            comparison.equal(f"csv {name} rows", len(messages), count + sum(1 for _ in rows))


def compare_jsonl(out, expected, comparison):
    waiting = {name: iter(messages) for name, messages in expected.items()}
    counts = collections.Counter()
    special = {"Infinity": math.inf, "-Infinity": -math.inf, None: math.nan}
    with open(out["jsonl"], encoding="utf-8") as file:
        for line in file:
            entry = json.loads(line)
            if "message" not in entry or entry.get("verified") is False:
                continue
            name = entry["message"]
            counts[name] += 1
            message = next(waiting.get(name, iter(())), None)
            if message is None:
                continue
            comparison.time("jsonl", name, message, entry["time_boot"], micros_of(entry["time_utc"]))
            for field, (kind, value) in message["fields"].items():
                def get(index, field=field, kind=kind, entry=entry):
                    found = entry["fields"][field] if index is None else entry["fields"][field][index]
                    return special.get(found, found) if kind in ("float", "double") else found
                comparison.field("jsonl", f"{name}.{field}", kind, value, get)
    for name, messages in expected.items():
        comparison.equal(f"jsonl {name} objects", len(messages), counts[name])


def compare_parquet(out, expected, comparison):
    for name, messages in expected.items():
        table = pyarrow.parquet.ParquetFile(out["parquet"][name]).read()
        comparison.equal(f"parquet {name} rows", len(messages), table.num_rows)
        columns = {column: table.column(column).to_pylist() for column in table.column_names}
        utc = table.column("utc").cast("int64").to_pylist()
        for row, message in enumerate(messages):
            comparison.time("parquet", name, message, columns["boot_s"][row], utc[row])
            for field, (kind, value) in message["fields"].items():
                column = columns.get(f"{field}_field") or columns[field]
                def get(index, column=column, row=row):
                    return column[row] if index is None else column[row][index]
                comparison.field("parquet", f"{name}.{field}", kind, value, get)


class Influx:
    """InfluxDB with an empty database in a folder of its own."""

    def __init__(self, program, folder):
        ports = []
        for _ in range(2):
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                ports.append(probe.getsockname()[1])
        config = os.path.join(folder, "influxdb.conf")
        with open(config, "w", encoding="utf-8") as file:
            file.write(f"""reporting-disabled = true
bind-address = "127.0.0.1:{ports[0]}"
[meta]
dir = "{folder}/meta"
[data]
dir = "{folder}/data"
wal-dir = "{folder}/wal"
query-log-enabled = false
[http]
bind-address = "127.0.0.1:{ports[1]}"
log-enabled = false
max-row-limit = 0
[monitor]
store-enabled = false
""")
        self.url = f"http://127.0.0.1:{ports[1]}"
        self.log = open(os.path.join(folder, "log"), "wb")
        self.server = subprocess.Popen([program, "run", "-config", config], stdout=self.log, stderr=self.log)
        for _ in range(200):
            try:
                self.ask("SHOW DATABASES")
                break
            except OSError:
                time.sleep(0.1)
        self.ask("CREATE DATABASE hums")

    def ask(self, question):
        body = urllib.parse.urlencode({"q": question, "db": "hums", "epoch": "ns"}).encode()
        with urllib.request.urlopen(f"{self.url}/query", body, timeout=120) as answer:
            result = json.load(answer)["results"][0]
        if "error" in result:
            sys.exit(f"{question}: {result['error']}")
        return result.get("series", [])

    def take(self, lines):
        request = urllib.request.Request(f"{self.url}/write?db=hums", b"".join(lines))
        try:
            urllib.request.urlopen(request, timeout=120).close()
        except urllib.error.HTTPError as error:
            sys.exit(f"InfluxDB refuses points: {error.read().decode()}")

    def end(self):
        self.server.terminate()
        self.server.wait(30)
        self.log.close()


def compare_influx(out, expected, comparison, program):
    with tempfile.TemporaryDirectory() as folder:
        influx = Influx(program, folder)
        try:
            points, batch = collections.Counter(), []
            with open(out["influx"], "rb") as file:
                for line in file:
                    points[re.match(rb"[^, ]+", line).group().decode()] += 1
                    batch.append(line)
                    if len(batch) == 5000:
                        influx.take(batch)
                        batch = []
            influx.take(batch)
            taken = sum(compare_measurement(influx, name, count, expected.get(name), comparison)
                        for name, count in points.items())
            comparison.equal("influx points", sum(points.values()), taken)
            return taken
        finally:
            influx.end()


def compare_measurement(influx, name, count, messages, comparison):
    """Asks for all points of a measurement; rows come in order of time, as in the record."""
    series = influx.ask(f'SELECT * FROM "{name}"')
    columns = {column: place for place, column in enumerate(series[0]["columns"])} if series else {}
    rows = series[0]["values"] if series else []
    comparison.equal(f"influx {name} points", count, len(rows))
    for row, message in zip(rows, messages or []):
        comparison.point_time(name, message, row[columns["time"]])
        for field, (kind, value) in message["fields"].items():
            def get(index, field=field, kind=kind, row=row):
                name = f"{field}_field" if field in ("time", "vehicle", "session", "system", "component") else field
                place = columns.get(name if index is None else f"{name}[{index}]")
                found = None if place is None else row[place]
                if kind in ("float", "double"):
                    return math.nan if found is None else found
                return int(found) if kind == "uint64_t" and found is not None else found
            # The protocol has no infinity: such a field is left out, as NaN is.
            finite = lambda v: math.nan if isinstance(v, float) and math.isinf(v) else v
            value = [finite(v) for v in value] if isinstance(value, list) else finite(value)
            if kind == "char":
                value = value.replace("\n", " ").replace("\r", " ")
            comparison.field("influx", f"{name}.{field}", kind, value, get)
    return len(rows)


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    dialect = load_dialect(sys.argv[1])
    with open(sys.argv[2], "rb") as file:
        data = file.read()
    expected = collections.defaultdict(list)
    arrival = Arrival()
    for message in messages_of(data, dialect, arrival):
        expected[message.get_type()].append({
            "at": arrival.at,
            "sender": (message.get_srcSystem(), message.get_srcComponent()),
            "fields": fields_of(message),
        })
    folder = sys.argv[3]
    one = lambda pattern: next(iter(glob.glob(os.path.join(folder, pattern))))
    parquet = glob.glob(os.path.join(folder, "*/date=*/bucket=*/*.parquet"))
    out = {
        "tables": os.path.dirname(one("*/HEARTBEAT.csv")),
        "jsonl": one("*.jsonl"),
        "influx": one("*.lp"),
        "parquet": {path.split(os.sep)[-4]: path for path in parquet},
    }
    comparison = Comparison(arrival)
    compare_csv(out, expected, comparison)
    compare_jsonl(out, expected, comparison)
    compare_parquet(out, expected, comparison)
    points = compare_influx(out, expected, comparison, sys.argv[4])
    print(json.dumps({
        "messages": sum(map(len, expected.values())),
        "types": len(expected),
        "values": comparison.values,
        "times": comparison.times,
        "points": points,
        "differences": comparison.differences,
    }))


if __name__ == "__main__":
    main()
