"""Reads what `hums decode` wrote for other programs, with readers that are not ours.

usage: exports.py OUT NAME        prints JSON: "wrong" (sentences), and counts

OUT has NAME.jsonl, which readback.py compares with pymavlink, and the same log as NAME.mcap, .ulg, .kml, .gpx and .srt. The readers
are the `mcap` package with the descriptors in the file, Foxglove's own message classes, pyulog, and an XML parser.
"""

import datetime
import json
import math
import re
import struct
import sys
import xml.etree.ElementTree

from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from pyulog import ULog

FOXGLOVE = {"foxglove.LocationFix": LocationFix, "foxglove.Log": Log, "foxglove.PoseInFrame": PoseInFrame}
GPX = "{http://www.topografix.com/GPX/1/1}"
KML, GX = "{http://www.opengis.net/kml/2.2}", "{http://www.google.com/kml/ext/2.2}"
# Elements of a waypoint in the order of GPX's schema, and of a Placemark in that of KML's.
WAYPOINT = ["ele", "time", "name", "desc", "type"]
PLACEMARK = ["name", "description", "TimeStamp", "styleUrl", "Track", "LineString", "Point"]

wrong, counts = [], {}


def check(right, words):
    if not right and len(wrong) < 50:
        wrong.append(words)


def utc_us(text):
    epoch = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
    return (datetime.datetime.fromisoformat(text.replace("Z", "+00:00")) - epoch) // datetime.timedelta(microseconds=1)


def time_ns(line):
    if line["time_utc"] is None:
        return round(line["time_boot"] * 1e6) * 1000
    return utc_us(line["time_utc"]) * 1000


def is_same(ours, theirs):
    """A value of JSON, and the same from a file with types: null is NaN there, and a float has 32 bits."""
    if isinstance(ours, list):
        return len(ours) == len(theirs) and all(map(is_same, ours, theirs))
    if isinstance(theirs, bytes):
        return ours == theirs.hex()
    if isinstance(theirs, float):
        if ours is None or math.isnan(theirs):
            return ours is None and math.isnan(theirs)
        ours = float(ours)
        return ours == theirs or (abs(ours) < 3.5e38 and struct.unpack("f", struct.pack("f", ours))[0] == theirs)
    return ours == theirs


def fields_of(message):
    values = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if hasattr(value, "append"):
            values[field.name] = list(value)
        else:
            values[field.name] = value if message.HasField(field.name) else None
    return values


def mcap(path, lines):
    expected = {}
    for line in lines:
        if "record" in line:
            package = "hums" if line["record"].startswith("HUMS_") else "log"
            topic = f"/{package}/{line['record']}"
        elif "fields" in line:
            topic = f"/mavlink/{line['system']}/{line['component']}/{line['message']}"
        else:
            topic = "/opaque"
        expected.setdefault(topic, []).append(line)
    seen = dict.fromkeys(expected, 0)
    derived, last = {}, 0
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            check(message.log_time >= last, f"{channel.topic}: its times fall")
            last = message.log_time
            if schema.name in FOXGLOVE:
                theirs = FOXGLOVE[schema.name].FromString(message.data)
                stamp = theirs.timestamp.seconds * 10**9 + theirs.timestamp.nanos
                check(stamp == message.log_time, f"{channel.topic}: another time in the message")
                derived.setdefault(channel.topic, []).append(theirs)
                continue
            if channel.topic not in seen:
                derived.setdefault(channel.topic, []).append(decoded)
                continue
            place, of = seen[channel.topic], expected[channel.topic]
            seen[channel.topic] += 1
            if place >= len(of):
                continue
            line, values = of[place], fields_of(decoded)
            check(time_ns(line) == message.log_time, f"{channel.topic} {place}: time {message.log_time}")
            if "fields" in line:
                # The names of columns are plain there.
                same = all(is_same(ours, theirs) for ours, theirs in zip(line["fields"].values(), values.values()))
                check(same and len(line["fields"]) == len(values), f"{channel.topic} {place}: {line['fields']} {values}")
            else:
                check(line["payload"] == values["payload"].hex(), f"{channel.topic} {place}: {values}")
    for topic, lines in expected.items():
        check(seen[topic] == len(lines), f"{topic}: {seen[topic]} of {len(lines)} messages")
    written = summary.statistics.message_count
    check(written == sum(seen.values()) + sum(map(len, derived.values())), f"{written} messages by the summary")
    check(len(summary.chunk_indexes) == summary.statistics.chunk_count, "not each chunk has an index")
    counts["mcap"] = {"messages": sum(seen.values()), "chunks": summary.statistics.chunk_count}
    counts["mcap"].update({topic: len(messages) for topic, messages in derived.items()})
    return derived


def places_of(lines):
    """Degrees by time, as the vehicle sent them."""
    fused = [line for line in lines if line.get("message") == "GLOBAL_POSITION_INT" and "fields" in line]
    return {time_ns(line): (line["fields"]["lat"] / 1e7, line["fields"]["lon"] / 1e7) for line in fused}


def ulog(path, lines):
    log = ULog(path)
    topics = {}
    for data in log.data_list:
        topics[data.name] = topics.get(data.name, 0) + len(data.data["timestamp"])
        check(all(a <= b for a, b in zip(data.data["timestamp"], data.data["timestamp"][1:])), f"{data.name}: times fall")
        if data.name == "vehicle_attitude":
            norms = sum(data.data[f"q[{part}]"] ** 2 for part in range(4))
            check(all(abs(norm - 1) < 1e-5 for norm in norms), "vehicle_attitude: a quaternion is not of length 1")
    said = [text.timestamp for text in log.logged_messages]
    check(all(a <= b + 1_000_000 for a, b in zip(said, said[1:])), "the times of texts and findings fall")
    attitudes = sum(1 for line in lines if line.get("message") == "ATTITUDE" and line["component"] == 1)
    if attitudes:
        check(topics.get("vehicle_attitude") == attitudes, f"vehicle_attitude: {topics} of {attitudes}")
    sent = {line["fields"]["param_id"] for line in lines if line.get("message") == "PARAM_VALUE" and line["component"] == 1}
    check(sent <= log.initial_parameters.keys(), f"parameters missing: {sent - log.initial_parameters.keys()}")
    counts["ulog"] = {**topics, "parameters": len(log.initial_parameters), "texts": len(log.logged_messages)}


def tag(element):
    return element.tag.rsplit("}", 1)[1]


def in_order(element, names):
    order = [names.index(tag(child)) for child in element if tag(child) in names]
    check(len(order) == len(element) and order == sorted(order), f"{tag(element)}: {[tag(child) for child in element]}")


def place(latitude, longitude, utc, known):
    check(-90 <= latitude <= 90 and -180 <= longitude <= 180, f"a place at {latitude}, {longitude}")
    if known and utc is not None:
        sent = known.get(utc_us(utc) * 1000)
        if sent is not None:
            counts["places_compared"] = counts.get("places_compared", 0) + 1
            check(abs(sent[0] - latitude) < 1e-6 and abs(sent[1] - longitude) < 1e-6, f"{utc}: {latitude}, {longitude} for {sent}")


def gpx(path, known):
    root = xml.etree.ElementTree.parse(path).getroot()
    check(root.tag == GPX + "gpx" and root.get("version") == "1.1" and root.get("creator"), "no GPX")
    order = [["metadata", "wpt", "rte", "trk"].index(tag(child)) for child in root]
    check(order == sorted(order), "gpx: the order of its parts")
    waypoints = root.findall(GPX + "wpt")
    points = root.findall(f"{GPX}trk/{GPX}trkseg/{GPX}trkpt")
    for point in waypoints + points:
        in_order(point, WAYPOINT)
        utc = point.findtext(GPX + "time")
        place(float(point.get("lat")), float(point.get("lon")), utc, known if point not in waypoints else {})
    times = [point.findtext(GPX + "time") for point in points]
    check(times == sorted(times, key=lambda time: time or ""), "gpx: times fall")
    counts["gpx"] = {"places": len(points), "findings": len(waypoints)}


def kml(path, known):
    root = xml.etree.ElementTree.parse(path).getroot()
    check(root.tag == KML + "kml", "no KML")
    styles = {style.get("id") for style in root.iter(KML + "Style")}
    places = findings = 0
    last = None
    for placemark in root.iter(KML + "Placemark"):
        in_order(placemark, PLACEMARK)
        track = placemark.find(GX + "Track")
        if track is None:
            findings += placemark.find(KML + "Point") is not None
            places += len((placemark.findtext(f"{KML}LineString/{KML}coordinates") or "").split())
            continue
        check(placemark.findtext(KML + "styleUrl")[1:] in styles, "kml: a style that is not there")
        whens, coords = track.findall(KML + "when"), track.findall(GX + "coord")
        check(len(whens) == len(coords) > 1, f"kml: {len(whens)} times of {len(coords)} places")
        for when, coord in zip(whens, coords):
            longitude, latitude, _ = map(float, coord.text.split())
            place(latitude, longitude, when.text, known)
        # A piece begins with the last place of the one before.
        places += len(coords) - (whens[0].text == last)
        last = whens[-1].text
    counts["kml"] = {"places": places, "findings": findings}


def srt(path):
    cues = re.split(r"\n\n", open(path, encoding="utf-8").read().strip())
    end, findings = 0, set()
    pattern = re.compile(r"(\d+)\n(\d\d):(\d\d):(\d\d),(\d{3}) --> (\d\d):(\d\d):(\d\d),(\d{3})\n(.+)", re.S)
    for number, cue in enumerate(cues, 1):
        match = pattern.fullmatch(cue)
        check(match and int(match[1]) == number, f"srt: {cue!r}")
        if not match:
            continue
        parts = [int(part) for part in match.groups()[1:9]]
        times = [((h * 60 + m) * 60 + s) * 1000 + ms for h, m, s, ms in (parts[:4], parts[4:])]
        check(end <= times[0] < times[1], f"srt: {cue!r} comes before the end of the one before")
        end = times[1]
        findings.update(match[10].split("\n")[1:])
    counts["srt"] = {"cues": len(cues), "findings": len(findings), "end_ms": end, "first": cues[0].split("\n")}


def main(folder, name):
    with open(f"{folder}/{name}.jsonl", encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    derived, known = mcap(f"{folder}/{name}.mcap", lines), places_of(lines)
    for fix in derived.get("/position", []):
        sent = known.get(fix.timestamp.seconds * 10**9 + fix.timestamp.nanos)
        check(not sent or abs(sent[0] - fix.latitude) < 1e-9, f"/position: {fix.latitude} for {sent}")
    ulog(f"{folder}/{name}.ulg", lines)
    gpx(f"{folder}/{name}.gpx", known)
    kml(f"{folder}/{name}.kml", known)
    srt(f"{folder}/{name}.srt")
    print(json.dumps({"wrong": wrong, **counts}))


main(*sys.argv[1:])
