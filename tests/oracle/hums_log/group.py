"""Sections 4 and 5: the entries of a group, and the headers of frames."""

from arithmetic import M32, crc16_mcrf4xx
from coder import Cell, Coder, Distribution, TextModel
from payload import Payload
from records import Records

NONE = 255


class Sender:
    def __init__(self):
        self.sequence, self.link_id, self.signed_at = 0, 0, 0


class Slot:
    def __init__(self, number):
        self.number = number
        self.next = [NONE, NONE]
        self.frames, self.time, self.last_ms = 0, None, 0
        self.header = 0
        self.incompat = self.compat = 0
        self.payload = b""
        self.quiet, self.has_quiet = Cell(), False


class Group:
    """The entries of one group: decode() yields (ms, "frame" or "record", bytes, verified)."""

    TIME = [40, 10, 6, 4, 4, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4, 1]
    JUMPS = 2

    def __init__(self, stream, start_ms, layouts, links):
        self.coder, self.now = Coder(stream), start_ms
        self.layouts, self.links = layouts, links
        self.slots, self.senders = [], {}
        self.recent = [NONE, NONE, NONE]
        self.guesses = [[(NONE, 0)] * 256, [(NONE, 0)] * 512]
        self.kinds = [[Distribution([60, 12, 12, 8, 1, 2, 4, 1]) for _ in range(16)] for _ in range(2)]
        self.odd = 0  # how the last frame's header was coded
        self.upper, self.lower = Distribution(), [Distribution() for _ in range(7)]
        self.time, self.blocks, self.elements = Distribution(self.TIME), 432, 544
        self.header = [Distribution([4, 8, 80, 20, 1]) for _ in range(16)]
        self.first_header = Distribution([80, 4, 8, 4, 1])
        self.jump = [Distribution(), Distribution()]
        self.signed_later = Distribution()
        self.model = TextModel(self.coder)
        self.payload = Payload(self)
        self.records = Records(self.coder, self.model)

    def decode(self, count):
        for _ in range(count):
            yield self.entry()

    def entry(self):
        guesses, context = self.predict()
        symbol = self.coder.symbol(self.kinds[self.odd != 0][context])
        if symbol == 4:
            return self.plain()
        if symbol == 5:
            self.later(self.time)
            return self.now, "record", self.records.read(self.now), True
        expected = symbol < 4
        what = symbol if expected else symbol - 6
        if what == 3:
            slot = self.new_slot()
        elif what == 2:
            upper = self.coder.symbol(self.upper)
            slot = self.slots[upper << 4 | self.coder.symbol(self.lower[upper])]
        else:
            slot = self.slots[guesses[what]]
        self.came(slot)
        return self.frame(slot, expected and what != 3)

    # The next entry.

    def places(self):
        a, b, c = self.recent
        return ((a << 8 | b) * 0x9E3779B1 & M32) >> 16 & 255, ((a << 16 | b << 8 | c) * 0x85EBCA6B & M32) >> 16 & 511

    def predict(self):
        two, three = self.places()
        (second, sure2), (third, sure3) = self.guesses[0][two], self.guesses[1][three]
        follows = self.slots[self.recent[0]].next if self.recent[0] != NONE else [NONE, NONE]
        if third != NONE:
            first, context = third, 4 + sure3
        elif second != NONE:
            first, context = second, 8 + sure2
        else:
            first, context = follows[0], int(follows[0] != NONE)
        if first == second == follows[0] and context >= 7:
            context = 12 + (context & 3)
        others = [slot for slot in (second, *follows) if slot not in (NONE, first)]
        return (first, others[0] if others else NONE), context

    def came(self, slot):
        for table, place in zip(self.guesses, self.places()):
            guess, sure = table[place]
            table[place] = (guess, min(sure + 1, 3)) if guess == slot.number else (slot.number, 0)
        if self.recent[0] != NONE:
            before = self.slots[self.recent[0]]
            if before.next[0] != slot.number:
                before.next = [slot.number, before.next[0]]
        self.recent = [slot.number, *self.recent[:2]]

    def new_slot(self):
        bits = self.coder.bits
        slot = Slot(len(self.slots))
        slot.version = 2 if bits(1) else 1
        slot.system, slot.component = bits(8), bits(8)
        slot.message = bits(9) if bits(1) else bits(24)
        slot.sender = self.senders.setdefault((slot.system, slot.component), Sender())
        layout = self.layouts.get(slot.message)
        slot.seed, slot.verified = (layout.seed, True) if layout else (0, False)
        slot.instance = bytes(bits(8) for _ in range(layout.instance[1])) if layout and layout.instance else b""
        slot.layout, slot.elements = self.payload.elements(slot, layout)
        slot.trimmed = slot.version == 2 and slot.layout is not None
        slot.fixed = slot.layout.base_length if slot.layout else 0
        self.slots.append(slot)
        return slot

    def later(self, distribution):
        s = self.coder.symbol(distribution)
        if s < 10:
            ms = s
        elif s < 15:
            ms = (1 << (s - 7)) + self.coder.bits(s - 7)
        else:
            ms = self.coder.bits(32)
            ms |= self.coder.bits(16) << 32
        self.now += ms

    def plain(self):
        self.later(self.time)
        raw, verified = self.coder.bits(1), bool(self.coder.bits(1))
        length = self.coder.bits(10)
        data = bytes(self.coder.bits(8) for _ in range(length)) if raw else self.model.text(length)
        return self.now, "frame", data, verified

    # A frame of a slot.

    def frame(self, slot, expected):
        if slot.frames == 1 and self.blocks:
            self.blocks -= 1
            slot.time = self.time.renewed()
        self.later(slot.time or self.time)
        sequence, mode, checksum = self.read_header(slot, expected)
        sender = slot.sender
        if mode != 1:
            slot.payload = self.payload.read(slot, self.now - slot.last_ms)
            sender.sequence = sequence + 1 & 255
        payload = slot.payload
        slot.frames, slot.last_ms = slot.frames + 1, self.now
        ids = bytes([sequence, slot.system, slot.component]) + slot.message.to_bytes(3, "little")
        if slot.version == 2:
            frame = bytes([0xFD, len(payload), slot.incompat, slot.compat]) + ids + payload
        else:
            frame = bytes([0xFE, len(payload)]) + ids[:4] + payload
        if checksum is None:
            checksum = crc16_mcrf4xx(frame[1:] + bytes([slot.seed]))
        frame += checksum.to_bytes(2, "little")
        if slot.version == 2 and slot.incompat & 1:
            frame += self.signature(sender)
        return self.now, "frame", frame, slot.verified

    def read_header(self, slot, expected):
        """The sequence number, the row of the table in section 5, and the checksum if it is spelled out."""
        bits, checksum = self.coder.bits, None
        if expected:
            mode = 0
        elif slot.frames == 0:
            mode = self.coder.symbol(self.first_header)
        else:
            mode = self.coder.symbol(self.header[slot.header * 4 + self.odd])
        sequence = slot.sender.sequence
        if mode == 1:
            sequence -= 1
        elif mode >= 2:
            sequence += self.coder.symbol(self.jump[0]) << 4
            sequence += self.coder.symbol(self.jump[1])
        if mode == 3:
            slot.incompat, slot.compat, slot.verified = bits(8), bits(8), bool(bits(1))
            slot.fixed, slot.trimmed = bits(8), bool(bits(1))
            if bits(1):
                slot.seed = bits(8)
            else:
                checksum = bits(16)
        slot.header = self.odd = mode
        return sequence & 255, mode, checksum

    def signature(self, sender):
        bits = self.coder.bits
        if not bits(1):
            sender.link_id = bits(8)
        c = self.coder.symbol(self.signed_later)
        if c == 15:
            sender.signed_at = bits(32)
            sender.signed_at |= bits(16) << 32
        elif c:
            sender.signed_at = sender.signed_at + (1 << (c - 1)) + bits(c - 1) & (1 << 48) - 1
        return bytes([sender.link_id]) + sender.signed_at.to_bytes(6, "little") + bytes(bits(8) for _ in range(6))
