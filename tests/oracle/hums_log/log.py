"""Sections 1 and 2: sectors, parity and groups."""

import struct
from collections import Counter

from arithmetic import M32, crc32c, gf_inverse, gf_product
from group import Group
from tables import read_layouts, read_links


DATA, SUMS = b"\x48\xb3", [b"\x48\xc3", b"\x48\xd3"]
POWERS = [1]
while len(POWERS) < 255:
    POWERS.append(gf_product(POWERS[-1], 2))


class Sector:
    def __init__(self, block):
        flags, self.used, self.frames, self.session, self.number = struct.unpack_from("<BHHII", block, 2)
        self.since, self.partial, self.closed = flags & 63, bool(flags & 64), bool(flags & 128)
        self.used, self.records = self.used & 511, self.used >> 9
        self.check = int.from_bytes(block[15:19], "little")
        self.body = block[19:19 + self.used]
        self.rank = (not self.partial, self.frames + self.records)


def sectors_of(data):
    """The sound sectors of the first one's session by number; the best copy of each."""
    sectors, whole, parity, bases, session, begins = {}, {}, {}, Counter(), None, None
    for at in range(0, len(data) - 511, 512):
        block = data[at:at + 512]
        if block[:2] not in (DATA, *SUMS) or crc32c(block[:508]) != int.from_bytes(block[508:], "little"):
            continue
        sector = Sector(block)
        if block[:2] in SUMS:
            parity[sector.session, sector.number, SUMS.index(block[:2])] = block
            continue
        session = sector.session if session is None else session
        if sector.session == session and begins is None:
            begins = sector.number - at // 512
        known = sectors.get(sector.number)
        if sector.session == session and (known is None or sector.rank > known.rank):
            sectors[sector.number] = sector
            if not sector.partial:
                whole[sector.number] = block
                bases[sector.number - at // 512] += 1
    if bases:
        own = {(last, kind): block for (of, last, kind), block in parity.items() if of == session}
        for block in made_again(whole, own, max(begins, bases.most_common(1)[0][0])):
            sector = Sector(block)
            sectors[sector.number] = sector
    return sectors


def made_again(whole, parity, base):
    """The lost sectors, from the parity sectors by (last number, P or Q): up to two in a column, from sums of one age."""
    for last in sorted({last for last, _ in parity if last >= base}):
        numbers = [base + at for at in range((last - base) // 504 * 504 + (last - base) % 8, last - base + 1, 8)]
        lost = [number for number in numbers if number not in whole]
        sums = [parity.get((last, kind)) for kind in (0, 1)]
        if not 1 <= len(lost) <= sum(held is not None for held in sums):
            continue
        rests = []
        for kind, held in enumerate(sums):
            if held is not None:
                rest = bytearray(held[2:7] + held[15:508])
                for number in set(numbers) - set(lost):
                    weight = POWERS[(last - number) // 8 % 255] if kind else 1
                    part = whole[number][2:7] + whole[number][15:508]
                    rest = bytearray(a ^ gf_product(weight, b) for a, b in zip(rest, part))
                rests.append((kind, rest))
        weights = [POWERS[(last - number) // 8 % 255] for number in lost]
        if len(lost) == 1:
            kind, rest = rests[0]
            parts = [bytes(gf_product(gf_inverse(weights[0]) if kind else 1, byte) for byte in rest)]
        else:
            (_, p), (_, q) = rests
            over = gf_inverse(weights[0] ^ weights[1])
            one = bytes(gf_product(over, b ^ gf_product(weights[1], a)) for a, b in zip(p, q))
            parts = [one, bytes(a ^ b for a, b in zip(p, one))]
        session = next(held for held in sums if held is not None)[7:11]
        for number, part in zip(lost, parts):
            if any(part):
                yield DATA + part[:5] + session + number.to_bytes(4, "little") + part[5:] + bytes(4)


def groups_of(sectors):
    """The sectors of each group, as far as they are consecutive."""
    for first in sorted(number for number, sector in sectors.items() if sector.since == 0):
        group = [sectors[first]]
        while not group[-1].partial and len(group) < 64:
            sector = sectors.get(first + len(group))
            if sector is None or sector.since != len(group):
                break
            group.append(sector)
        yield group


def checked(decoder, group, chain, complain):
    """The entries of a group, sector by sector, up to one whose chained check fails."""
    for sector in group:
        entries = list(decoder.decode(sector.frames + sector.records))
        for ms, what, content, verified in entries:
            kind = 2 if what == "record" else int(verified)
            entry = crc32c(struct.pack("<QBH", ms, kind, len(content)) + content)
            chain = crc32c(entry.to_bytes(4, "little"), chain)
        if chain != sector.check:
            complain(f"sector {sector.number}: its entries are not those that came")
            return
        yield from entries


def read(data, complain):
    """The entries of a log: (ms since power-on, UTC at power-on in microseconds, what, bytes, verified)."""
    layouts, links, entries, next_frame, chain, epoch = {}, read_links(), [], None, None, 0
    for group in groups_of(sectors_of(data)):
        head = group[0].body[:26]
        digest, start_ms = int.from_bytes(head[:4], "little"), int.from_bytes(head[4:10], "little")
        before, utc, chain_before = struct.unpack_from("<IQI", head, 10)
        epoch = utc or epoch
        if next_frame is not None and next_frame != before:
            complain(f"gap before {start_ms} ms: {before - next_frame & M32} frames are missing")
        elif chain is not None and chain != chain_before:
            complain(f"the group at {start_ms} ms does not go on from the sector before it")
        if digest not in layouts:
            layouts[digest] = read_layouts(digest)
        stream = b"".join(sector.body for sector in group)[26:]
        next_frame, chain = before, group[-1].check
        for entry in checked(Group(stream, start_ms, layouts[digest], links), group, crc32c(head), complain):
            next_frame = next_frame + (entry[1] == "frame") & M32
            if entry[1] == "record" and entry[2][:1] == b"\4":
                boot_us, utc_us = struct.unpack_from("<QQ", entry[2], 4)
                epoch = utc_us - boot_us
            entries.append(entry)
    return [(ms, epoch, *rest) for ms, *rest in entries]
