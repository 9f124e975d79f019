"""What pymavlink finds in recorded flights: the reference that the end-to-end tests compare with.

usage: manifest.py DIALECT.py FILE...        prints JSON

DIALECT.py is made by pymavlink's mavgen. A FILE is a tlog (8 bytes of time before each frame) or the raw bytes of a
port; which of the two is told from its first bytes. For each file:

  frames            frames whose checksum pymavlink verified
  frames_by_id      the same per message id
  sha256            SHA-256 over the bytes of those frames, in their order
  unverified_by_id  entries of a tlog whose message id the dialect does not know: nobody can verify their checksum
  misfits_by_id     entries of a tlog whose checksum fails (another definition of that id, or damage)
  bytes_other       bytes of a raw file that belong to no verified frame

and once, `crc_extra`: the checksum seed of each known message id.
"""

import collections
import hashlib
import importlib.util
import json
import os
import sys

STX_V1, STX_V2 = 0xFE, 0xFD
SIGNED = 0x01


def load_dialect(path):
    spec = importlib.util.spec_from_file_location("hums_dialect", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def frame_at(data, at):
    """(length, message id) of what may be a frame at this place, or None where none fits."""
    left = len(data) - at
    if left >= 8 and data[at] == STX_V1:
        length, message_id = 8 + data[at + 1], data[at + 5]
    elif left >= 12 and data[at] == STX_V2:
        if data[at + 2] & ~SIGNED:
            return None
        length = 12 + data[at + 1] + (13 if data[at + 2] & SIGNED else 0)
        message_id = int.from_bytes(data[at + 7:at + 10], "little")
    else:
        return None
    return (length, message_id) if length <= left else None


class Reader:
    """pymavlink's decoder, asked about one possible frame at a time."""

    def __init__(self, dialect):
        self.dialect = dialect
        self.mav = dialect.MAVLink(None)

    def verifies(self, frame, message_id):
        if message_id not in self.dialect.mavlink_map:
            return False
        try:
            message = self.mav.decode(bytearray(frame))
        except self.dialect.MAVError:
            return False
        return message.get_msgId() == message_id


class Tally:
    def __init__(self):
        self.by_id = collections.Counter()
        self.unverified = collections.Counter()
        self.misfits = collections.Counter()
        self.bytes_other = 0
        self.digest = hashlib.sha256()

    def add(self, frame, message_id):
        self.by_id[message_id] += 1
        self.digest.update(frame)

    def as_dict(self, path, kind):
        counts = lambda counter: {str(key): counter[key] for key in sorted(counter)}
        return {
            "bytes": os.path.getsize(path),
            "kind": kind,
            "frames": sum(self.by_id.values()),
            "frames_by_id": counts(self.by_id),
            "sha256": self.digest.hexdigest(),
            "unverified_by_id": counts(self.unverified),
            "misfits_by_id": counts(self.misfits),
            "bytes_other": self.bytes_other,
        }


def is_tlog(data):
    """Three entries in a row, each a time between 2001 and 2100 and a frame."""
    at = 0
    for _ in range(3):
        time_us = int.from_bytes(data[at:at + 8], "big")
        found = frame_at(data, at + 8)
        if not 978_307_200_000_000 < time_us < 4_102_444_800_000_000 or found is None:
            return False
        at += 8 + found[0]
        if at >= len(data):
            break
    return True


def read_tlog(data, reader, tally):
    at = 0
    while at + 8 < len(data):
        found = frame_at(data, at + 8)
        if found is None:
            # The structure is lost: on to the next place where a time and a frame fit.
            tally.bytes_other += 1
            at += 1
            continue
        length, message_id = found
        frame = data[at + 8:at + 8 + length]
        if reader.verifies(frame, message_id):
            tally.add(frame, message_id)
        elif message_id in reader.dialect.mavlink_map:
            tally.misfits[message_id] += 1
        else:
            tally.unverified[message_id] += 1
        at += 8 + length


def read_raw(data, reader, tally):
    at = 0
    while at < len(data):
        found = frame_at(data, at)
        if found is not None and reader.verifies(data[at:at + found[0]], found[1]):
            tally.add(data[at:at + found[0]], found[1])
            at += found[0]
        else:
            tally.bytes_other += 1
            at += 1


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    dialect = load_dialect(sys.argv[1])
    flights = {}
    for path in sys.argv[2:]:
        with open(path, "rb") as file:
            data = file.read()
        tally, reader = Tally(), Reader(dialect)
        kind = "tlog" if is_tlog(data) else "raw"
        (read_tlog if kind == "tlog" else read_raw)(data, reader, tally)
        flights[os.path.basename(path)] = tally.as_dict(path, kind)
    seeds = {str(key): dialect.mavlink_map[key].crc_extra for key in sorted(dialect.mavlink_map)}
    print(json.dumps({"made_by": "HUMS_WRITE_DOCS=1 cargo xtask test --only sim", "flights": flights, "crc_extra": seeds}, indent=1))


if __name__ == "__main__":
    main()
