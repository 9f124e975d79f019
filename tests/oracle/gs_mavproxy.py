"""Uses MAVProxy's prompt, with the box as its vehicle, and prints the results.

usage: gs_mavproxy.py PORT FOLDER        prints JSON
  PORT    the UDP port at which `hums sim --gs udpin:127.0.0.1:PORT` listens; its SIGN_PORT is 1 and its GS_SIGN 2
  FOLDER  gets MAVProxy's own files and the oldest log: log.bin by LOG_REQUEST_DATA, ftp.hum by FTP

Each step is MAVProxy's output, or null if it did not come in time.
"""

import json
import os
import queue
import re
import subprocess
import sys
import threading
import time


class Prompt:
    def __init__(self, port, folder):
        program = os.path.join(os.path.dirname(sys.executable), "mavproxy.py")
        command = [sys.executable, program, f"--master=udpout:127.0.0.1:{port}", "--target-system=1",
                   "--target-component=191", "--source-system=255", f"--state-basedir={folder}",
                   "--default-modules=log,param,signing,cmdlong,ftp"]
        self.process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True, bufsize=1)
        self.lines = queue.Queue()
        self.said = []
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.process.stdout:
            self.lines.put(line.rstrip())

    def expect(self, pattern, seconds):
        end = time.time() + seconds
        while time.time() < end:
            try:
                line = self.lines.get(timeout=0.2)
            except queue.Empty:
                continue
            self.said.append(line)
            found = re.search(pattern, line)
            if found:
                return found.group(1) if found.groups() else found.group(0)
        return None

    def type(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def ask(self, text, pattern, seconds=6, tries=1):
        for _ in range(tries):
            self.type(text)
            answer = self.expect(pattern, seconds)
            if answer is not None:
                return answer
        return None

    def close(self):
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder = sys.argv[2]
    os.makedirs(folder, exist_ok=True)
    prompt = Prompt(sys.argv[1], folder)
    # Its first start compiles all of it: a slow machine takes half a minute.
    out = {"detected": prompt.expect(r"Detected vehicle 1:191", 60)}

    def show(name):
        return prompt.ask(f"param show {name}", rf"{name} {{2,}}(\S+)", 4, 2)

    out["received"] = prompt.ask("param fetch", r"Received (\d+) parameters", 15, 2)
    out["shown"] = show("GS_BUDGET")
    prompt.type("param set BAT_REM_WARN 33")
    time.sleep(2)
    out["set"] = show("BAT_REM_WARN")
    prompt.type("param set BAT_REM_WARN 1000")
    time.sleep(2)
    prompt.ask("param fetch BAT_REM_WARN", r"Requested parameter", 4)
    time.sleep(2)
    out["refused"] = show("BAT_REM_WARN")
    out["logs"] = prompt.ask("log list", r"Log 1 +numLogs (\d+)", 6, 3)
    log = os.path.join(folder, "log.bin")
    out["downloaded"] = prompt.ask(f"log download 1 {log}", r"Finished downloading .*\((\d+) bytes", 60)
    log = os.path.join(folder, "ftp.hum")
    out["got"] = prompt.ask(f"ftp get /00001_00.HUM {log}", r"Wrote (\d+)", 60)
    out["crc"] = prompt.ask("ftp crc /00001_00.HUM", r"(0x[0-9a-fA-F]{8}) in", 20)
    prompt.type("signing setup passphrase-of-this-flight")
    out["key"] = prompt.expect(r"HUMS: signing key set", 6)
    prompt.type("param set BAT_REM_WARN 34")
    time.sleep(2)
    out["signed"] = show("BAT_REM_WARN")
    prompt.close()
    out["said"] = prompt.said[-40:]
    print(json.dumps(out))


if __name__ == "__main__":
    main()
