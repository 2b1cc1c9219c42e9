"""Screenshots of the live page in headless Chromium: python page.py PROGRAM MODEL FOLDER

MODEL is shown on a desktop's screen and on a phone's. Needs the package playwright (not its browsers), Pillow, and Chromium at
/usr/bin/chromium or where CHROMIUM says.
"""

import io
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

from PIL import Image
from playwright.sync_api import sync_playwright

CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
SWITCHES = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync"]
# Name, screen size, device pixel ratio, theme.
SCREENS = [("desktop", (1280, 800), 1, "dark"), ("material", (1280, 800), 1, "dark"), ("phone", (390, 844), 2, "light")]
SAMPLES = 16
LARGEST = 200_000


def start(program, model):
    process = subprocess.Popen([program, "view", model, "--no-open", "--width", "960", "--height", "540", "--spp", "64"],
                               stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if found := re.search(r"http://127\.0\.0\.1:\d+/[0-9a-f]+/", line):
            return process, found.group()
    sys.exit("the program ended before it had a page")


def wait_for(page, condition):
    end = time.monotonic() + 120
    while not page.evaluate(condition):
        if time.monotonic() > end:
            sys.exit(f"waited in vain for {condition}")
        page.wait_for_timeout(100)


def shoot(browser, address, screen, folder):
    name, (width, height), scale, theme = screen
    is_phone = name == "phone"
    page = browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=scale, color_scheme=theme,
                            has_touch=is_phone, is_mobile=is_phone)
    page.goto(address)
    wait_for(page, f"Number(document.body.dataset.denoised) >= {SAMPLES}")
    # Before and after the denoiser, and the outline of what the mouse points at.
    is_split = name == "desktop"
    page.locator("#split").fill("0.35" if is_split else "0")
    wait_for(page, f"document.getElementById('split-line').hidden === {str(not is_split).lower()}")
    wait_for(page, "document.querySelector('#thumbnails button:nth-child(2) canvas').width > 100")
    if not is_phone:
        box = page.locator("#picture").bounding_box()
        page.mouse.move(box["x"] + 0.55 * box["width"], box["y"] + 0.45 * box["height"])
        wait_for(page, "document.getElementById('outline').getAttribute('d')?.length > 0")
    if name == "material":
        page.mouse.click(box["x"] + 0.26 * box["width"], box["y"] + 0.27 * box["height"])
        wait_for(page, "!document.getElementById('material-fields').hidden")
        page.locator("#base_color").fill("#3a6fb0")
        page.locator("#scene-light-strength").fill("0.5")
        page.locator("#toml").scroll_into_view_if_needed()
        # The old picture stays for a moment after a change.
        wait_for(page, f"Number(document.body.dataset.denoised) < {SAMPLES}")
        wait_for(page, f"Number(document.body.dataset.denoised) >= {SAMPLES}")
    page.evaluate("document.activeElement.blur()")
    page.wait_for_timeout(500)
    path = folder / f"page-{name}.jpg"
    picture = Image.open(io.BytesIO(page.screenshot()))
    page.close()
    # Full chroma resolution keeps text sharp.
    picture.convert("RGB").save(path, quality=80, subsampling=0, optimize=True)
    assert path.stat().st_size < LARGEST, f"{path} has {path.stat().st_size} bytes"


def main():
    program, model, folder = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    process, address = start(program, model)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SWITCHES)
            for screen in SCREENS:
                shoot(browser, address, screen, folder)
            browser.close()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(10)


if __name__ == "__main__":
    main()
