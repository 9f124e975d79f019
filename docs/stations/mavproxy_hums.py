"""Shows in MAVProxy what a HUMS box says: MAVProxy itself drops the texts of every component but the autopilot.

Put this file beside MAVProxy's own modules, or into a folder that PYTHONPATH names, and load it by one line:

    module load mavproxy_hums

or with --load-module=mavproxy_hums. What the box says (STATUSTEXT of component 191 of the vehicle that MAVProxy shows) then
stands in the console in the colours of its severity; what is critical is spoken too, where MAVProxy's speech module is loaded.
The console window has a field HUMS with the worst level of all parts (NAMED_VALUE_FLOAT HUMS_LEVEL). The command `hums` prints
the level and the last texts again.
"""

import collections
import time

from MAVProxy.modules.lib import mp_module

COMPONENT = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
CRITICAL = 2  # MAV_SEVERITY_CRITICAL
LEVELS = ["ok", "advisory", "warning", "critical", "no data"]
COLOURS = ["green", "blue", "orange", "red", "grey"]
KEPT = 20


def colours(severity):
    """Foreground and background, as MAVProxy shows the autopilot's own."""
    if severity <= CRITICAL:
        return "white", "red"
    if severity <= 4:
        return "black", "orange"
    return ("black", "yellow") if severity == 5 else ("white", (0, 128, 0))


class HumsModule(mp_module.MPModule):
    def __init__(self, mpstate):
        super().__init__(mpstate, "hums", "health and usage monitor (HUMS)")
        self.add_command("hums", self.cmd_hums, "what the HUMS box said last")
        self.texts = collections.deque(maxlen=KEPT)
        self.level = None
        self.console.set_status("HUMS", "HUMS --", row=1, fg="black")

    def mavlink_packet(self, message):
        if message.get_srcComponent() != COMPONENT:
            return
        kind = message.get_type()
        if kind == "STATUSTEXT" and message.text.startswith("HUMS: "):
            self.show(message.severity, message.text)
        elif kind == "NAMED_VALUE_FLOAT" and message.name == "HUMS_LEVEL":
            self.show_level(int(message.value))

    def show(self, severity, text):
        self.texts.append((time.strftime("%H:%M:%S"), text))
        fg, bg = colours(severity)
        self.console.writeln(text, fg=fg, bg=bg)
        # The speech module has this setting; without it `say` would only print the text a second time.
        if severity <= CRITICAL and getattr(self.settings, "speech", 0):
            self.say(text)

    def show_level(self, level):
        if level == self.level or not 0 <= level < len(LEVELS):
            return
        self.level = level
        self.console.set_status("HUMS", f"HUMS {LEVELS[level]}", row=1, fg=COLOURS[level])

    def cmd_hums(self, args):
        print("HUMS level: " + ("not heard" if self.level is None else LEVELS[self.level]))
        for at, text in self.texts:
            print(f"{at} {text}")


def init(mpstate):
    """Makes the module, for MAVProxy."""
    return HumsModule(mpstate)
