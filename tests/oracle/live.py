"""Controls `hums live` or the check in Chromium, step by step.

usage: live.py CHROMIUM CHROMEDRIVER        a JSON object a line on standard input is answered by one on standard output

  {"do": "new"}                             a new tab without data of the one before, which is closed
  {"do": "open", "url": U, "scheme": "light" | "dark", "width": W, "height": H}
  {"do": "media", "media": "" | "print", "features": {NAME: VALUE}}     the medium and preferences: `prefers-color-scheme`, `prefers-contrast`, ...
  {"do": "pdf", "path": P}                  a print on A4
  {"do": "read"}                            the content of the page at one moment: see READ
  {"do": "wait", "script": JS, "limit_s": S}  until the script returns something true; answers its result
  {"do": "run", "script": JS}               answers its result
  {"do": "press", "keys": [...]}            key presses, by name or as the character
  {"do": "files", "selector": CSS, "paths": [...]}    chooses files, or a folder, in an input
  {"do": "drop", "paths": [...]}            drops files and folders onto the window
  {"do": "downloads", "path": P}            saved files go to this folder
  {"do": "shot", "path": P, "whole": BOOL}  a screenshot, of the window or of the whole page
  {"do": "console"}                         the browser's complaints since the last time
  {"do": "look", "page": P, "parts": [...]}   the content of a report: see report.py
  {"do": "quit"}                            the end
"""

import base64
import json
import sys
import tempfile

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

import report

FLAGS = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--no-first-run", "--disable-default-apps",
         "--force-device-scale-factor=1", "--window-size=1440,900"]

READ = """
const text = (node) => node.textContent;
const all = (selector) => [...document.querySelectorAll(selector)];
const shown = (node) => node.checkVisibility();
return {
  now: Number(document.documentElement.dataset.now),
  title: document.title,
  overall: text(document.getElementById("overall")),
  source: text(document.getElementById("source")),
  notice: document.getElementById("notice").hidden ? "" : text(document.getElementById("notice")),
  values: Object.fromEntries(all("[data-value]").map((node) => [node.dataset.value, text(node)])),
  panels: Object.fromEntries(all("[data-panel]").filter(shown).map((node) => [node.dataset.panel, {
    stale: node.classList.contains("stale"), none: node.classList.contains("none"), corner: text(node.querySelector(".corner")),
  }])),
  board: Object.fromEntries(all(".board li").map((node) => [node.dataset.subsystem, {
    level: text(node.querySelector(".badge")), reason: text(node.querySelector(".reason")), by: text(node.querySelector("small")),
  }])),
  notes: all(".notes li").map((node) => [text(node.querySelector("time")), text(node.querySelector(".badge")), text(node.querySelector(".words"))]),
  vehicles: all(".vehicles button").map(text),
  width: [document.documentElement.scrollWidth, innerWidth],
};
"""


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    options = webdriver.ChromeOptions()
    options.binary_location = sys.argv[1]
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    with tempfile.TemporaryDirectory() as profile:
        for flag in [*FLAGS, f"--user-data-dir={profile}"]:
            options.add_argument(flag)
        driver = webdriver.Chrome(options=options, service=Service(sys.argv[2]))
        driver.set_script_timeout(120)
        try:
            for line in sys.stdin:
                if json.loads(line)["do"] == "quit":
                    break
                print(json.dumps(step(driver, json.loads(line))), flush=True)
        finally:
            driver.quit()


def step(driver, asked):
    do = asked["do"]
    if do == "new":
        before = driver.current_window_handle
        driver.switch_to.new_window("tab")
        tab = driver.current_window_handle
        driver.switch_to.window(before)
        driver.close()
        driver.switch_to.window(tab)
        driver.execute_cdp_cmd("Storage.clearDataForOrigin", {"origin": "*", "storageTypes": "all"})
        driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "deny"})
        driver.execute_cdp_cmd("Network.clearBrowserCache", {})
        for kind in ["browser", "performance"]:
            driver.get_log(kind)
        return None
    if do == "look":
        return report.look(driver, asked["page"], asked["parts"])
    if do == "open":
        size = {"width": asked["width"], "height": asked["height"]}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                               {**size, "deviceScaleFactor": 1, "mobile": asked["width"] < 720})
        scheme = {"name": "prefers-color-scheme", "value": asked["scheme"]}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        driver.get(asked["url"])
        return None
    if do == "media":
        features = [{"name": name, "value": value} for name, value in asked["features"].items()]
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": asked["media"], "features": features})
        return None
    if do == "pdf":
        made = driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": False, "paperWidth": 8.27, "paperHeight": 11.69})
        with open(asked["path"], "wb") as file:
            file.write(base64.b64decode(made["data"]))
        return None
    if do == "read":
        return driver.execute_script(READ)
    if do == "wait":
        return WebDriverWait(driver, asked["limit_s"], poll_frequency=0.05).until(
            lambda driver: driver.execute_script(asked["script"]))
    if do == "run":
        return driver.execute_script(asked["script"])
    if do == "press":
        for key in asked["keys"]:
            ActionChains(driver).send_keys(getattr(Keys, key, key)).perform()
        return None
    if do == "files":
        driver.find_element("css selector", asked["selector"]).send_keys("\n".join(asked["paths"]))
        return None
    if do == "drop":
        data = {"items": [], "files": asked["paths"], "dragOperationsMask": 1}
        # Over the page's margin first, as a mouse comes in.
        for kind, at in [("dragEnter", 1), ("dragOver", 1), ("dragOver", 100), ("drop", 100)]:
            driver.execute_cdp_cmd("Input.dispatchDragEvent", {"type": kind, "x": at, "y": at, "data": data})
        return None
    if do == "downloads":
        driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": asked["path"]})
        return None
    if do == "shot":
        taken = driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "png", "captureBeyondViewport": asked["whole"]})
        with open(asked["path"], "wb") as file:
            file.write(base64.b64decode(taken["data"]))
        return None
    if do == "console":
        return [entry["message"] for entry in driver.get_log("browser")]
    raise ValueError(do)


if __name__ == "__main__":
    main()
