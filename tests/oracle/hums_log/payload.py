"""Section 6: payloads."""

import math

from arithmetic import M32, M64, bits_of, float_of, signed, single, toward_zero
from coder import Distribution
from tables import CHAR, FLOAT, INSTANCE, MICROS, MILLIS, SIGNED, SIZES


# Registers: the first whole one, the first of three angles, of the quaternion made of them, of the one told; two times.
WHOLE, ANGLES, QUATERNION, TOLD, TIMES = 31, 0, 23, 27, 43


class Element:
    """One value of a payload, with its history."""

    def __init__(self, what, offset, size, kind, role, links):
        self.what, self.offset, self.size, self.kind, self.role = what, offset, size, kind, role
        self.links, self.is_quaternion = links, False
        self.value, self.run, self.is_first = b"" if what == "text" else 0, 0, True
        self.step, self.step_in_hundredths = 0, False
        self.costs = [0, 0, 0, 100, 100, 100]
        self.decimals, self.exponent = 0, 120
        self.clock, self.linked, self.linked_whole = 0, 0.0, 0
        self.own = {}  # the distributions "block" and "other"
        self.last_class = 0
        self.kept = False  # of a text: it has a place in the group's 1024 bytes

    @property
    def quiet(self):
        return self.run >= 8

    def charge(self, predictions, distance):
        for i, prediction in enumerate(predictions):
            d = min(max(distance(prediction), -(1 << 31)), (1 << 31) - 1)
            self.costs[i] += (d ^ (d >> 31)).bit_length() - (self.costs[i] >> 3)

    def choose(self, predictions):
        """The prediction with the least cost, which is 0 for a first value."""
        return 0 if self.is_first else predictions[min(range(len(predictions)), key=lambda i: self.costs[i])]

    def count_decimals(self, value, is_decimal):
        if value not in (0, self.value):
            self.decimals = min(self.decimals + 1, 6) if is_decimal else max(self.decimals - 2, 0)


def in_order(bits):
    return signed(bits ^ 0x7FFF_FFFF if bits >> 31 else bits)


def out_of_order(order):
    order &= M32
    return order ^ 0x7FFF_FFFF if order >> 31 else order


def hundredths(bits):
    """n if the value is n * 0.01, otherwise None."""
    value = single(float_of(bits) * 100)
    if not abs(value) < 1 << 23:
        return None
    n = int(math.copysign(math.floor(abs(value) + 0.5), value))
    return n if of_hundredths(n) == bits else None


def of_hundredths(n):
    return bits_of(single(n * single(0.01)))


SINE = [1 / 6227020800, -1 / 39916800, 1 / 362880, -1 / 5040, 1 / 120, -1 / 6]
COSINE = [1 / 479001600, -1 / 3628800, 1 / 40320, -1 / 720, 1 / 24, -1 / 2]


def sine_and_cosine(angle):
    """By their series, each operation in single precision."""
    square = single(angle * angle)

    def series(terms):
        total = 0.0
        for term in terms:
            total = single(single(total + single(term)) * square)
        return total

    return single(angle + single(angle * series(SINE))), single(1 + series(COSINE))


class Payload:
    """Reads payloads; the common state of a group's slots."""

    KINDS = {("int", 1): 0, ("int", 2): 1, ("int", 4): 2, ("float", 4): 3, ("time", 4): 6, ("wide", 8): 6}
    HUNDREDTHS, RANDOM, COMPUTED = 4, 5, 7
    # The kinds with distributions by the previous class.
    AFTER = {0: 0, 1: 0, 2: 0, 3: 1, 4: 2, 6: 3}

    def __init__(self, group):
        self.group, self.coder = group, group.coder
        self.first_of_kind = [Distribution() for _ in range(8)]
        self.calm = [Distribution([600, 20]) for _ in range(8)]
        self.young = [Distribution() for _ in range(8)]
        self.clock, self.millis = 0, 0
        self.after = [[Distribution() for _ in range(16)] for _ in range(4)]
        self.registers = [0.0] * WHOLE + [0] * 14
        self.text_same, self.text_length = Distribution(), (Distribution(), Distribution())
        self.text_room = 1024

    def elements(self, slot, layout):
        """The layout that the slot uses, if any, and its elements."""
        if layout is None or layout.length > 255:
            return None, []
        elements, offset = [], 0
        for kind, role, count in layout.fields:
            size, many = SIZES[kind], max(count, 1)
            if layout.instance and offset == layout.instance[0]:
                offset += size * many
                continue
            if kind == CHAR or size == 1 and count >= 16:
                what, size, many = "text", size * many, 1
            elif kind == FLOAT:
                what = "float"
            elif size == 8:
                what = "wide"
            else:
                what = "time" if role in (MILLIS, MICROS) and size == 4 else "int"
            for _ in range(many):
                links = self.group.links.get((slot.message, offset), {})
                elements.append(Element(what, offset, size, kind, role, links))
                elements[-1].is_quaternion = slot.message == 31 and 4 <= offset < 20
                offset += size
        cost = sum(2 if one.what == "wide" else 1 for one in elements) + (layout.instance is not None)
        if cost > min(255, self.group.elements):
            return None, []
        self.group.elements -= cost
        return layout, elements

    def read(self, slot, elapsed_ms):
        """The payload of a slot's next frame."""
        length = slot.layout.length if slot.layout else 0
        image = bytearray(max(length, 0 if slot.trimmed else slot.fixed))
        if slot.instance and slot.layout:
            at, size = slot.layout.instance
            image[at:at + size] = slot.instance
        still = False
        if slot.has_quiet:
            still = bool(self.coder.bit(min(max(slot.quiet.p, 16), 4080)))
            slot.quiet.adapt(still)
        clock, neighbour = self.clock, None
        limit = slot.fixed if slot.version == 1 else length
        elements = [one for one in slot.elements if one.offset + one.size <= limit]
        ends = [one.offset + one.size for one in elements]
        if slot.instance and slot.layout and sum(slot.layout.instance) <= limit:
            ends.append(sum(slot.layout.instance))
        for one in elements:
            if not (still and one.quiet):
                before = one.value
                one.value = getattr(self, one.what)(one, elapsed_ms, clock, neighbour)
                self.publish(one)
                if one.what == "float":
                    neighbour = (float_of(before), float_of(one.value))
                is_same = one.value == before and (one.what != "text" or one.kept)
                one.run, one.is_first = one.run + 1 if is_same else 0, False
            image[one.offset:one.offset + one.size] = self.bytes_of(one)
        slot.has_quiet = any(one.quiet for one in elements)
        if slot.trimmed:
            return bytes(image).rstrip(b"\0") or b"\0"
        for at in range(max(ends, default=0), slot.fixed):
            image[at] = self.group.model.byte(256 + at)
        return bytes(image[:slot.fixed])

    def publish(self, one):
        if "publishes" in one.links:
            register, scale = one.links["publishes"]
            if register >= WHOLE:
                self.registers[register] = one.value
                return
            if one.what == "float":
                number = float_of(one.value)
            else:
                number = single(signed(one.value, 8 * one.size) if one.kind in SIGNED else one.value)
            self.registers[register] = single(number * scale)

    def make_quaternion(self):
        """The quaternion of the angles, with the sign of the last received one."""
        def product(*factors):
            result = factors[0]
            for factor in factors[1:]:
                result = single(result * factor)
            return result

        halves = [sine_and_cosine(product(self.registers[ANGLES + axis], 0.5)) for axis in range(3)]
        (sr, cr), (sp, cp), (sy, cy) = halves
        cc, ss, cs, sc = product(cr, cp), product(sr, sp), product(cr, sp), product(sr, cp)
        made = [
            single(product(cc, cy) + product(ss, sy)),
            single(product(sc, cy) - product(cs, sy)),
            single(product(cs, cy) + product(sc, sy)),
            single(product(cc, sy) - product(ss, cy)),
        ]
        terms = [product(part, self.registers[TOLD + i]) for i, part in enumerate(made)]
        turned = single(single(terms[0] + terms[1]) + single(terms[2] + terms[3])) < 0
        self.registers[QUATERNION:QUATERNION + 4] = [-part if turned else part for part in made]

    def a_class(self, one, which, kind):
        if which not in one.own and one.is_first:
            return self.coder.symbol(self.first_of_kind[kind])
        if which not in one.own:
            symbol = self.coder.symbol(self.calm[kind])
            if symbol and self.group.blocks:
                self.group.blocks -= 1
                one.own[which] = self.young[kind].renewed()
                one.own[which].adapt(symbol)
                self.young[kind].adapt(symbol)
        elif kind in self.AFTER:
            symbol = self.coder.symbol_between(one.own[which], self.after[self.AFTER[kind]][one.last_class])
        else:
            symbol = self.coder.symbol(one.own[which])
        one.last_class = symbol
        return symbol

    def difference(self, symbol):
        """An integer, whose class is read already."""
        if symbol == 15:
            symbol += self.coder.bits(5)
        return self.coder.magnitude(symbol) if symbol else 0

    def int(self, one, *_):
        bits = 8 * one.size
        predictions = [one.value, one.value + one.step, one.value + toward_zero(one.step, 2)]
        if "consults" in one.links:
            linked = self.linked_whole(*one.links["consults"])
            predictions += [linked, one.value + linked - one.linked_whole]
            one.linked_whole = linked
        difference = self.difference(self.a_class(one, "block", self.KINDS["int", one.size]))
        value = one.choose(predictions) + difference & (1 << bits) - 1
        one.charge(predictions, lambda p: signed(value - p, bits))
        one.step = 0 if one.is_first else signed(value - one.value, bits)
        return value

    def linked_whole(self, register, scale):
        if register >= WHOLE:
            return self.registers[register]
        number = single(self.registers[register] * scale)
        return 0 if math.isnan(number) else int(min(max(number, -(1 << 31)), (1 << 31) - 1))

    def time(self, one, elapsed_ms, clock, _):
        by_clock = clock - one.clock & M32
        if one.role == MILLIS:
            by_clock = (by_clock + 500 & M32) * 4294968 >> 32
        arrival = elapsed_ms * (1000 if one.role == MICROS else 1)
        predictions = [one.value, one.value + one.step, one.value + arrival, one.value + by_clock, self.millis]
        difference = self.difference(self.a_class(one, "block", self.KINDS["time", 4]))
        value = one.choose(predictions) + difference & M32
        one.charge(predictions, lambda p: signed(value - p))
        one.step = 0 if one.is_first else signed(value - one.value)
        self.propose(one, value - one.value, clock)
        if one.role == MILLIS:
            self.millis = value
        return value

    def propose(self, one, step, clock):
        is_millis = one.what == "time" and one.role == MILLIS
        proposal = one.clock + step * (1000 if is_millis else 1) & M32
        if (proposal - self.clock & M32) < 10_000_000:
            self.clock = proposal
        one.clock = clock

    def wide(self, one, elapsed_ms, clock, _):
        predictions = [one.value, one.value + one.step & M64]
        if one.role in (MILLIS, MICROS):
            predictions += [one.value + 1000 * elapsed_ms & M64, one.value + signed(clock - one.clock) & M64]
        prediction = one.choose(predictions)
        thousands = one.decimals >= 3 and one.value % 1000 == 0
        symbol = self.a_class(one, "block", self.KINDS["wide", 8])
        if symbol == 15 and self.coder.bits(1):
            value = self.coder.bits(32)
            value |= self.coder.bits(32) << 32
        elif thousands:
            value = ((prediction + 500 & M64) // 1000 + self.difference(symbol)) * 1000 & M64
        else:
            value = prediction + self.difference(symbol) & M64
        one.charge(predictions, lambda p: signed(value - p, 64))
        step = 0 if one.is_first else signed(value - one.value, 64)
        one.step = step if -(1 << 31) <= step < 1 << 31 else 0
        one.count_decimals(value, value % 1000 == 0)
        if one.role in (MILLIS, MICROS):
            self.propose(one, value - one.value, clock)
        return value

    def float(self, one, _elapsed_ms, _clock, neighbour):
        last, order = float_of(one.value), in_order(one.value)
        step = 0 if one.step_in_hundredths else one.step
        predictions = [order, order + step, order + toward_zero(step, 2)]
        computed = [last + single(neighbour[1] - neighbour[0])] if neighbour else [last]
        is_computed = False
        if "consults" in one.links:
            register, scale = one.links["consults"]
            if register == QUATERNION:
                self.make_quaternion()
            is_computed = one.is_quaternion and self.registers[TIMES] == self.registers[TIMES + 1]
            linked = single(self.registers[register] * scale)
            computed += [last + single(linked - one.linked), linked]
            one.linked = linked
        predictions += [order if math.isnan(number) else in_order(bits_of(single(number))) for number in computed]
        value, step = self.float_value(one, predictions, is_computed)
        one.charge(predictions, lambda p: signed(in_order(value) - p))
        one.count_decimals(value, hundredths(value) is not None)
        if step is None:
            one.step = signed(in_order(value) - in_order(one.value))
        else:
            one.step = step
        one.step_in_hundredths = step is not None
        return value

    def float_value(self, one, predictions, is_computed):
        """The value's bits, and its step if that is in hundredths."""
        bits, n = self.coder.bits, hundredths(one.value)
        if one.decimals >= 3 and n is not None:
            linear = one.step_in_hundredths and one.costs[1] < one.costs[0]
            symbol = self.a_class(one, "other", self.HUNDREDTHS)
            if symbol != 15 or not bits(1):
                value = n + (one.step if linear else 0) + self.difference(symbol)
                return of_hundredths(value), value - n
        if not one.is_first and is_computed:
            symbol = self.a_class(one, "other", self.COMPUTED)
            return out_of_order(predictions[-1] + self.difference(symbol)), None
        if not one.is_first and min(one.costs[:len(predictions)]) >= 192:
            symbol = self.a_class(one, "other", self.RANDOM)
            if symbol == 0:
                return one.value, None
            if symbol == 15:
                value = bits(32)
                one.exponent = value >> 23 & 255
                return value, None
            exponent, low = one.exponent + symbol - 8 & 255, bits(24)
            return (low >> 23) << 31 | exponent << 23 | low & 0x7F_FFFF, None
        symbol = self.a_class(one, "block", self.KINDS["float", 4])
        if symbol == 0:
            difference = 0
        elif symbol <= 4:
            width = (4, 8, 10, 12)[symbol - 1]
            coded = bits(width + 1)
            difference = coded & (1 << width) - 1
            difference = -difference if coded >> width else difference
        else:
            difference = self.coder.magnitude(23 + bits(4) if symbol == 15 else symbol + 8)
        return out_of_order(one.choose(predictions) + difference), None

    def text(self, one, *_):
        if one.is_first and one.size <= self.text_room:
            self.text_room -= one.size
            one.kept = True
        same = self.coder.symbol(self.text_same) == 0
        if same:
            return one.value
        length = self.coder.symbol(self.text_length[0]) << 4
        length |= self.coder.symbol(self.text_length[1])
        return self.group.model.text(length, one.value if one.kept else b"")

    def bytes_of(self, one):
        return one.value.ljust(one.size, b"\0") if one.what == "text" else one.value.to_bytes(one.size, "little")
