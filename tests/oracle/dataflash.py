"""Every message of an ArduPilot log as pymavlink's DFReader reads it.

usage: dataflash.py LOG        prints a line of JSON for each message: [name, [value, ...]]

An array is a value for each element. NaN is null.
"""

import json
import math
import sys

from pymavlink import DFReader


def value_of(message, column, character):
    """A list, of one value unless it is an array."""
    if character == "a":
        return list(message._elements[message.fmt.colhash[column]])
    value = getattr(message, column)
    if isinstance(value, bytes):
        # The contents of files stay bytes: hexadecimal digits.
        value = value.hex()
    if isinstance(value, float) and not math.isfinite(value):
        value = None
    if character == "M" and isinstance(value, int):
        value &= 0xFF  # a mode is unsigned in the autopilot's own definition
    return [value]


def main(path):
    log = DFReader.DFReader_binary(path, zero_time_base=True)
    while True:
        message = log.recv_msg()
        if message is None:
            return
        values = []
        for column, character in zip(message.fmt.columns, message.fmt.msg_fmts):
            values += value_of(message, column, character)
        print(json.dumps([message.get_type(), values]))


main(sys.argv[1])
