"""Sections 3 and 7: the range coder, and the model of texts."""

from arithmetic import M32


class Distribution:
    def __init__(self, sizes=()):
        sizes = (list(sizes) + [sizes[-1] if sizes else 1] * 16)[:16]
        total = sum(sizes)
        self.places = [sum(sizes[:i + 1]) * 65535 // total for i in range(15)]
        self.count = 0

    def renewed(self):
        copy = Distribution()
        copy.places, copy.count = list(self.places), min(self.count, 2)
        return copy

    def adapt(self, symbol):
        if symbol == 0 and self.count == 20 and self.places[0] >= 0xF800:
            return
        k = next(k for k, limit in ((1, 0), (2, 2), (3, 7), (4, 19), (5, 20)) if self.count <= limit)
        more = (65535 >> k) - 16
        self.places = [p - (p >> k) + i + 1 + (more if i >= symbol else 0) for i, p in enumerate(self.places)]
        self.count = min(self.count + 1, 20)


class Cell:
    def __init__(self):
        self.p, self.n = 2048, 0

    def adapt(self, bit):
        self.p += ((4095 if bit else 0) - self.p) * (65535 // (self.n + 2)) >> 16
        self.n = min(self.n + 1, 15)


class Coder:
    def __init__(self, stream):
        self.stream, self.at = stream, 4
        self.low, self.range = 0, M32
        self.code = int.from_bytes((stream + bytes(4))[:4], "big")

    def part(self, b):
        self.range >>= b
        return min((self.code - self.low & M32) // self.range, (1 << b) - 1)

    def take(self, start, size):
        self.low = self.low + self.range * start & M32
        self.range = self.range * size & M32
        while True:
            settled = (self.low ^ (self.low + self.range & M32)) < 1 << 24
            if not settled:
                if self.range >= 1 << 16:
                    return
                self.range = -self.low & 0xFFFF
            byte = self.stream[self.at] if self.at < len(self.stream) else 0
            self.at += 1
            self.code = (self.code << 8 | byte) & M32
            self.low, self.range = self.low << 8 & M32, self.range << 8 & M32

    def bits(self, n):
        if n > 16:
            low = self.bits(16)
            return self.bits(n - 16) << 16 | low
        if n == 0:
            return 0
        part = self.part(n)
        self.take(part, 1)
        return part

    def symbol(self, distribution):
        part, places = self.part(16), distribution.places
        s = sum(place <= part for place in places)
        start = places[s - 1] if s else 0
        self.take(start, (places[s] if s < 15 else 65536) - start)
        distribution.adapt(s)
        return s

    def symbol_between(self, one, other):
        places = [(a + b + 1) // 2 for a, b in zip(one.places, other.places)]
        part = self.part(16)
        s = sum(place <= part for place in places)
        start = places[s - 1] if s else 0
        self.take(start, (places[s] if s < 15 else 65536) - start)
        one.adapt(s)
        other.adapt(s)
        return s

    def bit(self, p):
        one = self.part(12) < p
        self.take(0 if one else p, p if one else 4096 - p)
        return int(one)

    def magnitude(self, bits):
        """A number with its sign, of this many bits, the first of which is known."""
        if bits == 32:
            value = 1 << 31 | self.bits(31)
            return -value if self.bits(1) else value
        coded = self.bits(bits)
        value = 1 << (bits - 1) | coded & (1 << (bits - 1)) - 1
        return -value if coded >> (bits - 1) else value


def scramble(x, salt):
    y = (x ^ salt) * 0x85EBCA6B & M32
    return y ^ (y >> 15)


class TextModel:
    def __init__(self, coder):
        self.coder = coder
        self.rows = [Distribution() for _ in range(64)]
        self.same = [Cell() for _ in range(8)]

    def byte(self, context):
        upper = self.coder.symbol(self.row(context))
        return upper << 4 | self.coder.symbol(self.row(context ^ (16 + upper) << 24))

    def row(self, context):
        return self.rows[scramble(context, 0x20000003) * 0x9E3779B1 % (1 << 32) >> 26]

    def text(self, length, above=None):
        """This many bytes; each may repeat the text above (zeros beyond its end)."""
        text, before, matched = bytearray(), 0, 0
        for i in range(length):
            over = None
            if above is not None:
                cell = self.same[min(matched, 7)]
                same = self.coder.bit(min(max(cell.p, 16), 4080))
                cell.adapt(same)
                over = above[i] if i < len(above) else 0
            before = over if above is not None and same else self.byte(before)
            matched = matched + 1 if before == over else 0
            text.append(before)
        return bytes(text)
