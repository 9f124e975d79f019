"""Parses the box's stream to the ground station like a ground station, and strictly.

usage: gs_stream.py DIALECT.py STREAM        prints JSON

robust_parsing is off, so the first byte outside a valid frame ends this with an error.
  frames            all of them
  frames_by_sender  per "system/component"
  heartbeats        per "system/component/autopilot/type"
  computer          the last ONBOARD_COMPUTER_STATUS, and their number
"""

import collections
import json
import sys

from manifest import load_dialect


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    dialect = load_dialect(sys.argv[1])
    mav = dialect.MAVLink(None)
    mav.robust_parsing = False
    senders, heartbeats, sequences, gaps = collections.Counter(), collections.Counter(), {}, 0
    computer = {}
    with open(sys.argv[2], "rb") as stream:
        data = stream.read()
    for message in mav.parse_buffer(data) or []:
        if message.get_type().startswith("UNKNOWN"):
            sys.exit(f"message id {message.get_msgId()} is in no dialect")
        sender = f"{message.get_srcSystem()}/{message.get_srcComponent()}"
        senders[sender] += 1
        if message.get_srcComponent() == 191:
            last = sequences.get(sender)
            if last is not None and message.get_seq() != (last + 1) % 256:
                gaps += 1
            sequences[sender] = message.get_seq()
        if message.get_type() == "HEARTBEAT":
            heartbeats[f"{sender}/{message.autopilot}/{message.type}"] += 1
        if message.get_type() == "ONBOARD_COMPUTER_STATUS":
            computer = dict(message.to_dict(), count=computer.get("count", 0) + 1)
    if mav.buf_len() != 0:
        sys.exit(f"the stream ends inside a frame: {mav.buf_len()} bytes left")
    print(json.dumps({
        "frames": sum(senders.values()),
        "frames_by_sender": senders,
        "heartbeats": heartbeats,
        "sequence_gaps": gaps,
        "computer": computer,
    }))


if __name__ == "__main__":
    main()
