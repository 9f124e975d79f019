"""Plays the box's stream to MAVProxy, without and then with the module of docs/stations, and prints MAVProxy's output.

usage: gs_mavproxy_alerts.py STREAM MODULES FOLDER        prints JSON
  STREAM   the output of `hums sim --gs FILE`
  MODULES  the folder with mavproxy_hums.py
  FOLDER   gets MAVProxy's own files

`texts` are the box's texts in STREAM, `without` and `with` the lines in MAVProxy's console, `autopilot` whether a text of the
autopilot itself was shown, `again` the output of the command `hums`.
"""

import json
import os
import queue
import re
import socket
import subprocess
import sys
import threading
import time

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import ardupilotmega as mavlink  # noqa: E402

MINE = 191


def frames(path):
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    with open(path, "rb") as stream:
        parsed = parser.parse_buffer(stream.read()) or []
    return [frame for frame in parsed if frame.get_type() != "BAD_DATA"]


class Prompt:
    def __init__(self, modules, folder):
        program = os.path.join(os.path.dirname(sys.executable), "mavproxy.py")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        command = [sys.executable, program, f"--master=udpin:127.0.0.1:{self.port}", "--source-system=255",
                   f"--state-basedir={folder}", "--default-modules=link"]
        environment = dict(os.environ, PYTHONPATH=modules, PYTHONDONTWRITEBYTECODE="1")
        self.process = subprocess.Popen(command, cwd=folder, env=environment, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1)
        self.lines = queue.Queue()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.process.stdout:
            self.lines.put(line.rstrip())

    def type(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def until(self, pattern, seconds, repeat=None):
        """The lines up to one that matches; empty if none did in time."""
        seen, end = [], time.time() + seconds
        while time.time() < end:
            if repeat is not None:
                self.play([repeat])
            try:
                seen.append(self.lines.get(timeout=0.2))
            except queue.Empty:
                continue
            if re.search(pattern, seen[-1]):
                return seen
        return []

    def play(self, some):
        for frame in some:
            self.socket.sendto(frame.get_msgbuf(), ("127.0.0.1", self.port))
            # Not faster than a socket's buffer is emptied.
            time.sleep(0.001)

    def close(self):
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    stream, modules, folder = sys.argv[1:]
    os.makedirs(folder, exist_ok=True)
    sent = frames(stream)
    texts = [frame.text for frame in sent if frame.get_type() == "STATUSTEXT" and frame.get_srcComponent() == MINE]
    beats = [frame for frame in sent if frame.get_type() == "HEARTBEAT" and frame.get_srcComponent() != MINE]
    wanted = [frame for frame in sent
              if frame.get_srcComponent() == MINE and frame.get_type() in ("STATUSTEXT", "NAMED_VALUE_FLOAT", "HEARTBEAT")]
    # A text of the autopilot, which marks the end.
    sender = mavlink.MAVLink(None, srcSystem=sent[0].get_srcSystem(), srcComponent=beats[0].get_srcComponent())
    mark = mavlink.MAVLink_statustext_message(6, b"the end of it")
    mark.pack(sender)
    prompt = Prompt(modules, folder)
    # Its first start compiles everything: half a minute on a slow machine.
    out = {"texts": texts, "started": bool(prompt.until(r"Detected vehicle", 60, repeat=beats[0]))}

    def shown():
        prompt.play(beats[:1] + wanted + [mark])
        lines = prompt.until(r"AP: the end of it", 30)
        return lines and [line[line.find("HUMS: "):] for line in lines if "HUMS: " in line], bool(lines)

    out["without"], out["autopilot"] = shown()
    prompt.type("module load mavproxy_hums")
    out["loaded"] = bool(prompt.until(r"Loaded module mavproxy_hums", 20))
    # The same text is shown once in two seconds.
    time.sleep(2.1)
    out["with"], _ = shown()
    prompt.type("hums")
    out["level"] = (prompt.until(r"HUMS level: ", 10) or [""])[-1]
    out["again"] = [line[9:] for line in prompt.until(re.escape(texts[-1]), 10) if "HUMS: " in line]
    prompt.close()
    print(json.dumps(out))


if __name__ == "__main__":
    main()
