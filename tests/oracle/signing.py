"""Sends requests with pymavlink's own signing: unsigned, with the key, with another one, and replayed.

usage: signing.py DIALECT.py PORT STATE        prints JSON
  PORT   the UDP port at which `hums sim --gs udpin:127.0.0.1:PORT` listens
  STATE  a file: if it is missing, the box has no key yet and gets one; otherwise it is the state of an earlier run, which
         the box must have kept over a power-off
"""

import json
import os
import sys
import time

from companion import OURS, Peer, load_dialect, result, value

KEY = bytes(range(1, 33))
OTHER = bytes(range(2, 34))
NAME = b"BAT_REM_WARN"


def now():
    """10 us since 2015."""
    return int((time.time() - 1420070400) * 1e5)


class Signer(Peer):
    """A ground station that signs, and stores its frames."""

    def __init__(self, dialect, port, stamp):
        super().__init__(dialect, port)
        self.stamp = stamp
        self.sent = b""
        write = self.link.write

        def keep(data):
            self.sent = bytes(data)
            write(data)

        self.link.write = keep

    def use(self, key, signs=True):
        signing = self.mav.signing
        signing.secret_key = key
        signing.link_id = 5
        signing.timestamp = max(now(), self.stamp + 1)
        signing.sign_outgoing = signs

        def unsigned(mav, msg_id):
            # The vehicle's own frames come unaltered.
            return True

        signing.allow_unsigned_callback = unsigned

    def keep_stamp(self):
        self.stamp = self.mav.signing.timestamp

    def put(self, number):
        message = self.ask(
            lambda: self.mav.param_set_send(1, OURS, NAME, number, 9), self.param(NAME.decode()), 3.0, 3
        )
        return value(message)

    def tally(self, seconds):
        """Counts of our frames: signed, unsigned and bad ones; the first and the last stamp."""
        signed = unsigned = bad = 0
        judged = self.mav.signing
        good_before, wrong_before = judged.goodsig_count, judged.badsig_count
        stamps = []
        for message in self.messages(seconds):
            buffer = bytes(message.get_msgbuf())
            if message.get_type() == "BAD_DATA":
                bad += 1
            elif buffer[0] == 0xFD and buffer[2] & 1:
                signed += 1
                stamps.append(int.from_bytes(buffer[-12:-6], "little"))
            else:
                unsigned += 1
        rises = all(a < b for a, b in zip(stamps, stamps[1:]))
        # By pymavlink's verdict, the vehicle's own frames included.
        good, wrong = judged.goodsig_count - good_before, judged.badsig_count - wrong_before
        return {"signed": signed, "unsigned": unsigned, "bad": bad, "rises": rises, "good": good, "wrong": wrong,
                "first": stamps[0] if stamps else None, "last": stamps[-1] if stamps else None}


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    state = {}
    if os.path.exists(sys.argv[3]):
        with open(sys.argv[3]) as file:
            state = json.load(file)
    peer = Signer(load_dialect(sys.argv[1]), sys.argv[2], state.get("stamp", 0))
    mav = peer.mav
    out = {}
    ours = peer.ask(peer.beat, lambda m: m.get_type() == "HEARTBEAT", 10, 10)
    out["heard"] = ours is not None

    if not state:
        out["before"] = peer.put(20.0)
        out["plain"] = peer.tally(3)
        said = peer.ask(
            lambda: mav.setup_signing_send(1, OURS, KEY, now()),
            lambda m: m.get_type() == "STATUSTEXT" and "key" in m.text,
        )
        out["key"] = None if said is None else said.text
    else:
        # Frames that an earlier power-on accepted are replayed first.
        peer.use(KEY, signs=False)
        for frame in state["frames"]:
            peer.link.write(bytes.fromhex(frame))
        answers = [value(m) for m in peer.messages(1.5) if peer.param(NAME.decode())(m)]
        out["replayed_after_power_off"] = sorted(set(answers))

    peer.use(KEY)
    # Frames in transfer when the key was set are not signed.
    peer.tally(0.5)
    out["sealed"] = peer.tally(4)
    if state:
        out["stamps_go_on"] = out["sealed"]["first"] > state["heard"]

    peer.use(KEY, signs=False)
    out["unsigned_set"] = peer.put(40.0)
    out["unsigned_command"] = result(peer.command(2511))
    listed = peer.ask(
        lambda: mav.param_request_list_send(1, OURS), lambda m: m.get_type() == "PARAM_VALUE", 1.5, 3
    )
    out["unsigned_list"] = listed is None

    peer.use(KEY)
    frames = []
    out["signed_set"] = peer.put(21.0)
    frames.append(peer.sent.hex())
    out["signed_command"] = result(peer.command(401)) is not None
    out["signed_set_again"] = peer.put(23.0)
    frames.append(peer.sent.hex())
    peer.keep_stamp()

    # pymavlink would refuse our answers with another key: the answer is read with ours.
    peer.use(OTHER)
    mav.param_set_send(1, OURS, NAME, 50.0, 9)
    peer.use(KEY, signs=False)
    answers = [value(m) for m in peer.messages(1.0) if peer.param(NAME.decode())(m)]
    out["wrong_key"] = answers

    for frame in frames:
        peer.link.write(bytes.fromhex(frame))
    out["replayed"] = [value(m) for m in peer.messages(1.0) if peer.param(NAME.decode())(m)]

    peer.use(KEY)
    out["after"] = peer.put(24.0)
    frames.append(peer.sent.hex())
    peer.keep_stamp()
    heard = peer.tally(2)
    with open(sys.argv[3], "w") as file:
        json.dump({"frames": frames, "stamp": peer.stamp, "heard": heard["last"]}, file)
    print(json.dumps(out))


if __name__ == "__main__":
    main()
