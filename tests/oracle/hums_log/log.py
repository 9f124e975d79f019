"""Sections 1 and 2: sectors and groups."""

import struct

from arithmetic import M32, crc32c
from group import Group
from tables import read_layouts, read_links


class Sector:
    def __init__(self, block):
        flags, self.used, self.frames, self.session, self.number = struct.unpack_from("<BHHII", block, 2)
        self.since, self.partial, self.closed = flags & 63, bool(flags & 64), bool(flags & 128)
        self.used, self.records = self.used & 511, self.used >> 9
        self.body = block[15:15 + self.used]
        self.rank = (not self.partial, self.frames + self.records)


def sectors_of(data):
    """The sound sectors by their number, of the session of the first one; the best copy of each."""
    sectors, session = {}, None
    for at in range(0, len(data) - 511, 512):
        block = data[at:at + 512]
        if block[:2] != b"\x48\xb1" or crc32c(block[:508]) != int.from_bytes(block[508:], "little"):
            continue
        sector = Sector(block)
        session = sector.session if session is None else session
        known = sectors.get(sector.number)
        if sector.session == session and (known is None or sector.rank > known.rank):
            sectors[sector.number] = sector
    return sectors


def groups_of(sectors):
    """The sectors of each group that begins, as far as they follow one another."""
    for first in sorted(number for number, sector in sectors.items() if sector.since == 0):
        group = [sectors[first]]
        while not group[-1].partial and len(group) < 64:
            sector = sectors.get(first + len(group))
            if sector is None or sector.since != len(group):
                break
            group.append(sector)
        yield group


def read(data, complain):
    """The entries of a log: (ms since power-on, UTC at power-on in microseconds, what, bytes, verified)."""
    layouts, links, entries, next_frame, epoch = {}, read_links(), [], None, 0
    for group in groups_of(sectors_of(data)):
        head = group[0].body[:22]
        digest, start_ms = int.from_bytes(head[:4], "little"), int.from_bytes(head[4:10], "little")
        before, utc = struct.unpack_from("<IQ", head, 10)
        epoch = utc or epoch
        if next_frame is not None and next_frame != before:
            complain(f"gap before {start_ms} ms: {before - next_frame & M32} frames are missing")
        if digest not in layouts:
            layouts[digest] = read_layouts(digest)
        stream = b"".join(sector.body for sector in group)[22:]
        frames = sum(sector.frames for sector in group)
        count = frames + sum(sector.records for sector in group)
        next_frame = before + frames & M32
        for entry in Group(stream, start_ms, layouts[digest], links).decode(count):
            if entry[1] == "record" and entry[2][:1] == b"\4":
                boot_us, utc_us = struct.unpack_from("<QQ", entry[2], 4)
                epoch = utc_us - boot_us
            entries.append(entry)
    return [(ms, epoch, *rest) for ms, *rest in entries]
