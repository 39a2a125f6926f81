#!/usr/bin/env python3
"""Opens reports in headless Chromium: no error on the console, nothing asked of a network, the slider changes picture and
numbers, a frame change takes under 50 ms on 1000 frames, and nothing is wider than a phone.

usage: check_in_browser.py APSO_TRACK APSO_REPORT. Ends with 77, which CTest calls skipped, without Chromium or Selenium."""

import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile

try:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
except ImportError:
    print("skipped: no python3-selenium; ./install_dependencies.sh --with-browser installs it")
    sys.exit(77)
browser, chromedriver = shutil.which("chromium"), shutil.which("chromedriver")
if not browser or not chromedriver:
    print("skipped: no chromium with chromedriver; ./install_dependencies.sh --with-browser installs them")
    sys.exit(77)

FRAMES, LIMIT_MS, PHONE = 1000, 50, 390
# the median of a few rounds: the machine may be busy with other tests
MEASURE = """
const done = arguments[arguments.length - 1];
const image = document.querySelector('img.frame'), slider = document.getElementById('slider'), times = [];
(async () => {
  for (let i = 0; i < 60; ++i) {
    const begin = performance.now();
    slider.value = String((i * 37 + 11) % (Number(slider.max) + 1));
    slider.dispatchEvent(new Event('input'));
    await image.decode();
    document.body.getBoundingClientRect();
    times.push(performance.now() - begin);
  }
  times.sort((a, b) => a - b);
  done({median: times[30], p95: times[57]});
})().catch((e) => done({error: String(e)}));
"""
failures = []


def check(condition, what):
    if not condition:
        failures.append(what)
        print("FAILED: " + what)


def run(*command):
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def repeat(source, target, frames):
    """A run of many frames out of one of few: the same rows, pictures and poses again and again, later each time."""
    shutil.copytree(source, target)
    with open(os.path.join(source, "frames.csv")) as f:
        header, *rows = list(csv.reader(f))
    period = float(rows[-1][1]) - float(rows[0][1]) + 1 / 30
    with open(os.path.join(target, "frames.csv"), "w") as f:
        f.write(",".join(header) + "\n")
        for i in range(frames):
            row = list(rows[i % len(rows)])
            row[0], row[1] = str(i), "%.6f" % (float(row[1]) + period * (i // len(rows)))
            row[-1] = '"' + row[-1] + '"'
            f.write(",".join(row) + "\n")
    for name in ("trajectory.txt", "trajectory_features.txt", "groundtruth.txt"):
        with open(os.path.join(source, name)) as f:
            poses = [line.split() for line in f if not line.startswith("#")]
        with open(os.path.join(target, name), "w") as f:
            for k in range((frames + len(rows) - 1) // len(rows)):
                for pose in poses:
                    if float(pose[0]) < float(rows[-1][1]) + 0.01:
                        f.write(" ".join(["%.6f" % (float(pose[0]) + k * period)] + pose[1:]) + "\n")
    for i in range(len(rows), frames):
        shutil.copy(os.path.join(source, "thumbnails", "%06d.jpg" % (i % len(rows))), os.path.join(target, "thumbnails", "%06d.jpg" % i))


class Page:
    def __init__(self, file, width, height=900, dark=False):
        options = webdriver.ChromeOptions()
        options.binary_location = browser
        for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=%d,%d" % (width, height)):
            options.add_argument(argument)
        if width < 500:  # a window is never that narrow
            options.add_experimental_option("mobileEmulation", {"deviceMetrics": {"width": width, "height": height, "pixelRatio": 2}})
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        self.driver = webdriver.Chrome(service=Service(chromedriver), options=options)
        if dark:
            feature = {"name": "prefers-color-scheme", "value": "dark"}
            self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        self.name = "%s at %d px" % (os.path.basename(file), width)
        self.file = file
        self.driver.get("file://" + file)

    def __enter__(self):
        return self

    def script(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    def __exit__(self, *unused):
        wide = self.script("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
        check(wide <= 0, "%s: %s px wider than the window" % (self.name, wide))
        errors = [e["message"] for e in self.driver.get_log("browser")]
        check(not errors, "%s: console: %s" % (self.name, errors))
        asked = set()
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                asked.add(message["params"]["request"]["url"][:80])
        outside = [u for u in asked if not u.startswith(("data:", "file://" + self.file[:60]))]
        check(not outside, "%s: asked for %s" % (self.name, outside))
        check(any(u.startswith("file:") for u in asked), "%s: the log of requests lacks the page itself" % self.name)
        self.driver.quit()


def main(track, report):
    with tempfile.TemporaryDirectory() as folder:
        at = lambda name: os.path.join(folder, name)
        sequence = ("synthetic:walking_xyz", "--seed", "104")
        run(track, *sequence, "--max-frames", "60", "--spoil", "blank", "--quiet", "--report", "--output", at("small"))
        run(track, *sequence, "--max-frames", "60", "--spoil", "blank", "--quiet", "--no-refinement", "--report", "--output", at("plain"))
        repeat(at("small"), at("large"), FRAMES)
        run(report, at("large"), "--output", at("large.html"))
        run(report, at("small"), at("plain"), "--output", at("both.html"))
        size = os.path.getsize(at("large.html")) / 1e6
        check(size < 15, "the report of %d frames has %.1f MB" % (FRAMES, size))

        with Page(at("large.html"), 1280) as page:
            state = "return [document.querySelector('img.frame').src.length, document.querySelector('img.frame').dataset.frame, " \
                    "document.getElementById('numbers').innerText, document.querySelector('.sentence').textContent, " \
                    "document.getElementById('position').textContent]"
            move = "const s = document.getElementById('slider'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))"
            before = page.script(state)
            page.script(move, 437)
            after = page.script(state)
            check(before[1] == "0" and after[1] == "437", "the picture is that of frame 437, not %s" % after[1])
            for i, what in enumerate(("picture", "frame of the picture", "numbers", "sentence", "position")):
                check(before[i] != after[i], "the slider does not change the " + what)
            check(page.script("return document.querySelector('img.frame').decode().then(() => document.querySelector('img.frame').naturalWidth)") > 100,
                  "the picture cannot be decoded")
            page.script("document.querySelector('#events tbody tr:last-child').click()")
            check(page.script(state)[4] != after[4], "a click on an event does not show its frame")
            turned = "return document.querySelector('canvas.turn').toDataURL()"
            flat = page.script(turned)
            page.script("document.querySelector('canvas.turn').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'}))")
            page.driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
            check(page.script(turned) != flat, "the 3-D view does not turn")
            times = page.driver.execute_async_script(MEASURE)
            print("%d frames, %.1f MB: a frame change takes %s ms" % (FRAMES, size, times))
            check(times.get("median", 1e9) < LIMIT_MS, "a frame change takes %s ms" % times)
        for width, dark in ((1280, True), (PHONE, False)):
            with Page(at("both.html"), width, dark=dark) as page:
                check(page.script("return document.querySelectorAll('img.frame').length") == 2, page.name + ": two runs, two pictures")
                marked = page.script("return Array.from(document.querySelectorAll('tr.differs td:first-child')).map((e) => e.textContent)")
                check("pipeline.refine" in marked, "%s: the option that differs is not marked: %s" % (page.name, marked))
                check(page.script("return document.querySelectorAll('.uplot').length") >= 10, page.name + ": charts are missing")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
