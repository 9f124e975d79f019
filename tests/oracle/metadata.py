"""The component information of the box, through foreign readers: Python's xz, and pymavlink's client of MAVLink FTP.

usage: metadata.py pack JSON FILE         packs a text as in firmware/onboard/metadata
       metadata.py unpack FILE            prints the unpacked file
       metadata.py DIALECT.py fetch PORT FOLDER      requests COMPONENT_METADATA, fetches the files in it into FOLDER, prints JSON
       metadata.py words FILE             Mission Planner's reading of its file of descriptions; prints JSON
  PORT  the UDP port at which `hums sim --gs udpin:127.0.0.1:PORT` listens
"""

import json
import lzma
import os
import re
import sys
import time

os.environ["MAVLINK20"] = "1"

OURS = 191
REQUEST_MESSAGE = 512
COMPONENT_METADATA = 397


def pack(text):
    # The check of the smallest decoders, and a dictionary as long as the text.
    chain = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "dict_size": 1 << 17, "pb": 0}]
    return lzma.compress(text, format=lzma.FORMAT_XZ, check=lzma.CHECK_CRC32, filters=chain)


def checksum(data):
    """MAVLink FTP's: CRC-32 from 0, without an inversion at the end."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    return crc


class Station:
    def __init__(self, dialect, port):
        from manifest import load_dialect
        from pymavlink import mavftp, mavutil

        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255, source_component=190)
        # Its own dialects lack the message.
        self.link.mav = load_dialect(dialect).MAVLink(self.link, srcSystem=255, srcComponent=190)
        self.link.mav.robust_parsing = True
        self.ftp = mavftp.MAVFTP(self.link, 1, OURS)

    def metadata(self):
        for _ in range(20):
            self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
            self.link.mav.command_long_send(1, OURS, REQUEST_MESSAGE, 0, COMPONENT_METADATA, 0, 0, 0, 0, 0, 0)
            end = time.time() + 0.5
            while time.time() < end:
                message = self.link.recv_match(type="COMPONENT_METADATA", blocking=True, timeout=0.1)
                if message is not None and message.get_srcComponent() == OURS:
                    return message
        return None

    def fetch(self, path, into):
        self.ftp.cmd_get([path, into])
        result = self.ftp.process_ftp_reply("OpenFileRO", timeout=60)
        if result.return_code != 0:
            sys.exit(f"{path}: FTP ended with {result.return_code}")
        with open(into, "rb") as file:
            return file.read()


def fetch(dialect, port, folder):
    station = Station(dialect, port)
    message = station.metadata()
    if message is None:
        sys.exit("no COMPONENT_METADATA came")
    path = lambda uri: re.fullmatch(r"mftp://\[;comp=191\](/.*)", uri).group(1)
    general = station.fetch(path(message.uri), os.path.join(folder, "general.json"))
    out = {"uri": message.uri, "booted": message.time_boot_ms > 0, "crc": message.file_crc == checksum(general), "types": []}
    for entry in json.loads(general)["metadataTypes"]:
        name = path(entry["uri"])
        packed = station.fetch(name, os.path.join(folder, os.path.basename(name)))
        out["types"].append([entry["type"], name, entry["fileCrc"] == checksum(packed)])
    print(json.dumps(out))


def words(path):
    """`ParameterMetaDataRepositoryAPM`: Params / the kind of vehicle / the parameter / the key."""
    from xml.etree import ElementTree

    kind = ElementTree.parse(path).getroot().find("ArduCopter2")
    print(json.dumps({parameter.tag: {key.tag: key.text for key in parameter} for parameter in kind}))


def main():
    match sys.argv[1:]:
        case ["pack", text, into]:
            with open(text, "rb") as file, open(into, "wb") as out:
                out.write(pack(file.read()))
        case ["unpack", path]:
            with open(path, "rb") as file:
                sys.stdout.buffer.write(lzma.decompress(file.read()))
        case ["words", path]:
            words(path)
        case [dialect, "fetch", port, folder]:
            fetch(dialect, port, folder)
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
