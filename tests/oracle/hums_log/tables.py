"""Sections 8 and 10: the layouts of messages and their links, read from the document's sources."""

import re
from pathlib import Path

from arithmetic import crc32c, single

ROOT = Path(__file__).resolve().parents[3]
# The sizes of kinds 0 to 10, the signed ones among them, and the roles.
SIZES = [1, 1, 1, 2, 2, 4, 4, 4, 8, 8, 8]
SIGNED = {1, 4, 6, 9}
CHAR, FLOAT = 2, 7
INSTANCE, MILLIS, MICROS = 1, 2, 3


class Layout:
    def __init__(self, seed, base_length, fields):
        self.seed, self.base_length = seed, base_length
        self.fields = fields  # (kind, role, count) in wire order
        self.instance = None  # (offset, bytes)
        offset = 0
        for kind, role, count in fields:
            size = SIZES[kind] * max(count, 1)
            if role == INSTANCE and size <= 10:
                self.instance = (offset, size)
            offset += size
        self.length = offset


def read_layouts(digest):
    """The layout table that a group names."""
    for path in sorted((ROOT / "firmware/blackbox/layouts").glob("*.bin")):
        data = path.read_bytes()
        if crc32c(data) == digest:
            break
    else:
        raise SystemExit(f"no layout table has the checksum {digest:08x}")
    layouts, at = {}, 0
    while at < len(data):
        number, seed, base, count = int.from_bytes(data[at:at + 3], "little"), *data[at + 3:at + 6]
        pairs = data[at + 6:at + 6 + 2 * count]
        fields = [(pairs[i] & 15, pairs[i] >> 4 & 3, pairs[i + 1]) for i in range(0, len(pairs), 2)]
        layouts[number] = Layout(seed, base, fields)
        at += 6 + 2 * count
    return layouts


def read_links():
    """{(message, offset): {"consults" or "publishes": (register, scale)}}"""
    links = {}
    text = (ROOT / "docs/log-format.md").read_text().split("\n## 10. Links")[1]
    row = re.compile(r"^\| (\d+) \| (\d+) \| (publishes|consults) \| (\d+) \| (\S+) \|$", re.MULTILINE)
    for message, offset, what, register, scale in row.findall(text):
        links.setdefault((int(message), int(offset)), {})[what] = (int(register), single(float(scale)))
    return links
