"""Decodes a log by docs/log-format.md alone: a second decoder that shares no line with the monitor's own.

usage: hums_log LOG TLOG

TLOG becomes what `hums decode --format tlog` writes: for each frame its time (8 bytes, big endian, microseconds since
1970) and the frame. Printed is an object a line: each frame in hexadecimal, and the fields of the records. Gaps are
reported on stderr, with exit code 3. The modules follow the document's sections, which they name; the tables of layouts
and links are read from the document's sources.
"""

import json
import sys
from pathlib import Path

from log import read
from records import rows_of


def main(log, tlog):
    gaps = []
    with open(tlog, "wb") as tlog:
        for ms, epoch, what, content, verified in read(Path(log).read_bytes(), gaps.append):
            if what == "frame":
                tlog.write((epoch + ms * 1000).to_bytes(8, "big") + content)
                print(json.dumps({"time_boot": ms / 1000, "frame": content.hex(), "verified": verified}))
            else:
                for name, fields in rows_of(content):
                    print(json.dumps({"time_boot": ms / 1000, "record": name, "fields": fields}))
    for gap in gaps:
        print(gap, file=sys.stderr)
    return 3 if gaps else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
