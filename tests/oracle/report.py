"""A report in Chromium: `look` returns its content.

  console       the browser's complaints
  requests      addresses that the page requested, except its own
  title, text   of the page
  findings      time, level, check and words of each finding in the list
  tiles         label and value
  plots         for each plot: id, lines, the pixels of each line's colour, and the lines' values and the time at the mouse
  cursor        the time under the cursor, at the last of these
  modes         names of the flight modes, in order
  limits        pairs of warning and critical, by plot
  why           meanings of findings, and remedies
  because, consequences   causes of findings, and their effects
  map           the part of the map's pixels that is drawn on
  width         of the page and of the window, at the width of a phone

The mouse points at each of `parts`: how far from the left in each plot, 0 to 1.
"""

import json

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.support.ui import WebDriverWait

# The part of a canvas whose pixels differ from the commonest one.
DRAWN = """
const canvas = arguments[0];
const pixels = new Uint32Array(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.buffer);
const counts = new Map();
for (const pixel of pixels) counts.set(pixel, (counts.get(pixel) ?? 0) + 1);
return 1 - Math.max(...counts.values()) / pixels.length;
"""

# Pixels of a plot in the colour of each of its lines, without smoothed edges.
LINE_PIXELS = """
const [canvas, keys] = arguments;
const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
return keys.map((key) => {
  const [r, g, b] = getComputedStyle(key).borderTopColor.match(/[0-9]+/g).map(Number);
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    if (Math.abs(pixels[i] - r) + Math.abs(pixels[i + 1] - g) + Math.abs(pixels[i + 2] - b) < 30) count++;
  }
  return count;
});
"""

RANGE = """
const log = JSON.parse(document.getElementById("data").textContent).log;
return [log.start_s, log.end_s];
"""


# The names of the flight modes, in order.
MODES = """
return JSON.parse(document.getElementById("data").textContent).flight.modes[1].map(([, name]) => name);
"""
# The limits of warning and critical by plot.
LIMITS = """
const { plots } = JSON.parse(document.getElementById("data").textContent).flight;
return Object.fromEntries(plots.filter(({ limits }) => limits.length).map(({ id, limits }) => [id, limits]));
"""


# The content of the page, read in one request: each one takes time.
SHOWN = """
const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const text = (node) => node.textContent;
const part = (row, selector) => text(row.querySelector(selector));
return {
  title: document.title,
  text: document.body.innerText,
  findings: all(".notes .finding").map((row) => [part(row, "time"), part(row, ".badge"), row.dataset.check, part(row, ".words")]),
  gaps: all("tr.gap").map((row) => row.innerText),
  texts: all(".notes .text").map((row) => part(row, ".words")),
  tiles: Object.fromEntries(all(".tile").map((tile) => [tile.querySelector("small").innerText, tile.querySelector("b").innerText])),
  why: all(".notes .why").map(text),
  because: all(".notes .because:not([hidden])").map(text),
  consequences: all(".notes .consequences:not([hidden])").map(text),
};
"""
# The lines of a plot, and their values.
VALUES = """
return Object.fromEntries([...arguments[0].querySelectorAll(".keys button")].map((key) => {
  const value = key.querySelector("b").innerText.trim(), name = key.innerText.trim();
  return [name.slice(0, name.length - value.length).trim(), value.replaceAll("\\u202f", "")];
}));
"""


def point(driver, plot, part, time_range):
    """Moves the mouse over a plot and reads its lines' values."""
    over = plot.find_element("css selector", ".u-over")
    width = over.rect["width"]
    offset = round(width * (part - 0.5))
    ActionChains(driver, duration=0).move_to_element_with_offset(over, offset, 10).perform()
    at = time_range[0] + (round(width / 2) + offset) / width * (time_range[1] - time_range[0])
    return {"time_s": at, "values": driver.execute_script(VALUES, plot)}


def look(driver, page, parts):
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                           {"width": 1280, "height": 1000, "deviceScaleFactor": 1, "mobile": False})
    address = f"file://{page}"
    driver.get(address)
    WebDriverWait(driver, 60).until(
        lambda driver: driver.execute_script("return document.documentElement.dataset.ready") == "true")
    # Plots that never change fold away; the mouse points at each.
    driver.execute_script("for (const node of document.querySelectorAll('details')) node.open = true")
    time_range = driver.execute_script(RANGE)
    all_of = lambda selector: driver.find_elements("css selector", selector)
    shown = driver.execute_script(SHOWN)
    shown["plots"] = {}
    for plot in all_of(".plot"):
        driver.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
        canvas = plot.find_element("tag name", "canvas")
        shown["plots"][plot.get_attribute("id").removeprefix("plot-")] = {
            "lines": len(plot.find_elements("css selector", ".keys button")),
            "pixels": driver.execute_script(
                LINE_PIXELS, canvas, plot.find_elements("css selector", ".keys i")),
            "points": [point(driver, plot, part, time_range) for part in parts],
        }
    shown["cursor"] = driver.find_element("css selector", ".cursor-time").text
    shown["modes"] = driver.execute_script(MODES)
    shown["limits"] = driver.execute_script(LIMITS)
    shown["map"] = [driver.execute_script(DRAWN, canvas) for canvas in all_of("#map")]
    shown["timeline"] = driver.execute_script(DRAWN, driver.find_element("id", "timeline"))
    if all_of(".notes .finding"):
        # A click on a finding zooms in; the button goes back.
        driver.execute_script("arguments[0].click()", all_of(".notes .finding")[0])
        back = driver.find_element("css selector", ".back")
        WebDriverWait(driver, 10).until(lambda _: back.is_displayed())
        driver.execute_script("arguments[0].click()", back)
        WebDriverWait(driver, 10).until(lambda _: not back.is_displayed())
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                           {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True})
    WebDriverWait(driver, 10).until(
        lambda driver: driver.execute_script("return document.querySelector('.plot .uplot')?.clientWidth ?? 0") < 390)
    shown["width"] = driver.execute_script("return [document.documentElement.scrollWidth, innerWidth]")
    shown["console"] = [entry["message"] for entry in driver.get_log("browser")]
    events = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    # The browser's own first tab makes requests too.
    asked = [event["params"] for event in events if event["method"] == "Network.requestWillBeSent"]
    urls = {request["request"]["url"] for request in asked if request["documentURL"] == address}
    shown["requests"] = sorted(url for url in urls if url != address and not url.startswith("data:"))
    return shown

