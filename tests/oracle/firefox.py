"""Checks logs with `hums-check.html` in Firefox, by its own remote protocol, Marionette: JSON behind its length, on TCP.

usage: firefox.py FIREFOX PAGE INPUT...      at least two files; the answer is a JSON object:

  {"seconds": from the choice to the first verdict, "saved": findings as JSON lines, "reports": {name: the saved page}}
"""

import json
import pathlib
import socket
import subprocess
import sys
import tempfile
import time


class Firefox:
    """A headless Firefox with a profile of its own."""

    def __init__(self, program, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        preferences = {
            "marionette.port": port,
            "browser.download.folderList": 2,
            "browser.download.dir": str(folder / "saved"),
            "browser.download.useDownloadDir": True,
            "browser.download.always_ask_before_handling_new_types": False,
        }
        profile = folder / "profile"
        profile.mkdir()
        (folder / "saved").mkdir()
        (profile / "user.js").write_text(
            "".join(f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in preferences.items()))
        command = [program, "--headless", "--marionette", "--no-remote", "--profile", str(profile)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.count = 0
        self.rest = b""
        self.port = port

    def begin(self):
        self.socket = self.connect()
        self.receive()
        self("WebDriver:NewSession", {})

    def connect(self):
        for _ in range(600):
            try:
                return socket.create_connection(("127.0.0.1", self.port), timeout=600)
            except OSError:
                time.sleep(0.1)
        raise TimeoutError("Firefox does not listen")

    def more(self):
        part = self.socket.recv(65536)
        if not part:
            raise ConnectionError("Firefox closed the connection")
        self.rest += part

    def receive(self):
        while b":" not in self.rest:
            self.more()
        length, self.rest = self.rest.split(b":", 1)
        while len(self.rest) < int(length):
            self.more()
        message, self.rest = self.rest[:int(length)], self.rest[int(length):]
        return json.loads(message)

    def __call__(self, command, parameters):
        self.count += 1
        message = json.dumps([0, self.count, command, parameters]).encode()
        self.socket.sendall(b"%d:%s" % (len(message), message))
        _, _, error, result = self.receive()
        if error:
            raise RuntimeError(f"{command}: {error['message']}")
        return result.get("value", result) if isinstance(result, dict) else result

    def run(self, script):
        return self("WebDriver:ExecuteScript", {"script": script, "args": []})

    def wait(self, script, limit_s):
        end = time.monotonic() + limit_s
        while not self.run(script):
            if time.monotonic() > end:
                raise TimeoutError(script)
            time.sleep(0.05)

    def saved(self, folder, count):
        """The saved files, once there are so many and none is still written."""
        for _ in range(1200):
            files = sorted(folder.iterdir())
            if len(files) == count and all(file.stat().st_size and file.suffix != ".part" for file in files):
                return files
            time.sleep(0.05)
        raise TimeoutError(f"saved: {files}")

    def choose(self, selector, paths):
        found = self("WebDriver:FindElement", {"using": "css selector", "value": selector})
        (key,) = found.values()
        self("WebDriver:ElementSendKeys", {"id": key, "text": "\n".join(paths)})


SAVE = """
const named = (words) => [...document.querySelectorAll("button")].filter((button) => button.textContent === words);
for (const button of [...named("Save all findings"), ...named("Save report")]) button.click();
return named("Save report").length;
"""


def main():
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    _, program, page, *inputs = sys.argv
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        firefox = Firefox(program, folder)
        try:
            firefox.begin()
            firefox("WebDriver:Navigate", {"url": pathlib.Path(page).resolve().as_uri()})
            firefox.wait("return document.documentElement.dataset.ready === 'true'", 60)
            begun = time.monotonic()
            firefox.choose("#files", inputs)
            firefox.wait("return document.querySelector('.log') !== null", 300)
            seconds = time.monotonic() - begun
            firefox.wait("return document.documentElement.dataset.state === 'done'", 300)
            pages = firefox.run(SAVE)
            saved = firefox.saved(folder / "saved", pages + 1)
        finally:
            firefox.process.terminate()
            firefox.process.wait()
        lines, = (path.read_text() for path in saved if path.suffix not in (".html", ".htm"))
        print(json.dumps({"seconds": seconds, "saved": lines,
                          "reports": {path.name: path.read_bytes().decode() for path in saved if path.suffix == ".html"}}))


if __name__ == "__main__":
    main()
