"""Downloads a log like a ground station, with LOG_REQUEST_LIST and LOG_REQUEST_DATA, over a link that loses frames.

usage: log_download.py DIALECT.py PORT OUT LOSS        prints JSON
  PORT  the UDP port at which `hums sim --gs udpin:127.0.0.1:PORT` listens
  OUT   gets the oldest log's bytes
  LOSS  the part of frames that is lost, each way, from 0 to 1
"""

import json
import random
import sys
import time

from companion import OURS, Peer, load_dialect


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    peer = Peer(load_dialect(sys.argv[1]), sys.argv[2])
    loss = float(sys.argv[4])
    chance = random.Random(1)
    mav = peer.mav

    def heard(seconds):
        for message in peer.messages(seconds):
            if chance.random() >= loss:
                yield message

    def say(send):
        if chance.random() >= loss:
            send()

    for _ in range(20):
        peer.beat()
        if any(message.get_type() == "HEARTBEAT" for message in heard(0.5)):
            break

    entries = {}
    for _ in range(10):
        say(lambda: mav.log_request_list_send(1, OURS, 0, 0xFFFF))
        for message in heard(2):
            if message.get_type() == "LOG_ENTRY":
                entries[message.id] = message.size
                if len(entries) == message.num_logs:
                    break
        if entries and len(entries) == message.num_logs:
            break

    log = min(entries)
    size = entries[log]
    data, missing = bytearray(size), {at: min(90, size - at) for at in range(0, size, 90)}
    requests = 0
    end = time.time() + 100
    while missing and time.time() < end:
        first = min(missing)
        # All missing bytes of one row, like ground stations.
        last = first
        while last in missing:
            last += 90
        requests += 1
        say(lambda: mav.log_request_data_send(1, OURS, log, first, last - first))
        quiet = time.time() + 1.5
        for message in heard(20):
            if message.get_type() == "LOG_DATA" and message.id == log:
                quiet = time.time() + 1.5
                if missing.get(message.ofs) == message.count:
                    data[message.ofs : message.ofs + message.count] = bytes(message.data[: message.count])
                    del missing[message.ofs]
                if message.ofs + 90 >= last:
                    break
            if time.time() > quiet:
                break
    mav.log_request_end_send(1, OURS)
    with open(sys.argv[3], "wb") as out:
        out.write(data)
    print(json.dumps({"entries": entries, "size": size, "missing": len(missing), "requests": requests}))


if __name__ == "__main__":
    main()
