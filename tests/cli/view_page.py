"""Drives the page of `oscura view` in headless Chromium: python view_page.py PROGRAM [FOLDER FOR SCREENSHOTS]

Needs the package playwright (its own browsers are not needed) and Chromium at /usr/bin/chromium or where CHROMIUM says.
Prints what it measured, and exits with 1 at the first thing that is wrong.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

from playwright.sync_api import sync_playwright

CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
SWITCHES = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync"]
SCENE = """
[camera]
look_from = [0, 1, 5]
look_at = [0, 0.5, 0]
vfov = 40
[environment]
sky = { nadir = [0, 0, 0], zenith = [1, 1.5, 3] }
[materials.ball]
type = "lambert"
color = [0.8, 0.1, 0.1]
[[lights]]
name = "lamp"
point = { position = [2, 3, 3], power = 100 }
[[objects]]
sphere = { center = [0.4, 0.5, 0], radius = 0.5 }
material = "ball"
"""
# Mean red, green and blue of the canvas, and how many of its pixels differ from those of the last call.
LOOK = """() => {
  const canvas = document.getElementById("picture");
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const sum = [0, 0, 0];
  let changed = window.lastPixels?.length === data.length ? 0 : null;
  for (let i = 0; i < data.length; i += 4) {
    for (let c = 0; c < 3; c++) sum[c] += data[i + c];
    if (changed !== null && data[i] !== window.lastPixels[i]) changed++;
  }
  window.lastPixels = data;
  return { mean: sum.map((s) => s / (data.length / 4)), changed, size: [canvas.width, canvas.height] };
}"""


class Program:
    """The program, with the scene copied into a folder of its own."""

    def __init__(self, program, folder):
        self.scene = pathlib.Path(folder) / "ball.toml"
        self.scene.write_text(SCENE)
        command = [program, "view", str(self.scene), "--no-open", "--watch", "--width", "480", "--height", "270",
                   "--spp", "200"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        self.address = None
        while self.address is None:
            line = self.process.stderr.readline()
            assert line, "the program ended before it had a page"
            found = re.search(r"http://127\.0\.0\.1:\d+/[0-9a-f]+/", line)
            self.address = found and found.group()

    def end(self):
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(10) == 0, "a signal ends it in good order"


def wait_for(page, condition, what):
    # The page's security policy forbids the waiting that is built in, which evaluates text.
    end = time.monotonic() + 60
    while not page.evaluate(condition):
        assert time.monotonic() < end, what
        page.wait_for_timeout(20)


def wait_to_see(page, suits, what):
    """What the picture looks like, as soon as that suits: a choice takes a while to be shown."""
    end = time.monotonic() + 60
    while not suits(seen := page.evaluate(LOOK)):
        assert time.monotonic() < end, f"{what}: {seen}"
        page.wait_for_timeout(50)
    return seen


def check_hosts(address):
    """Other names for this machine, pages of other sites, and who doesn't know the key are refused."""
    without_key = re.sub("/[0-9a-f]+/$", "/", address)
    for url, headers in [(address, {"Host": "evil.example"}), (address, {"Origin": "http://evil.example"}),
                         (address, {"Sec-Fetch-Site": "cross-site"}), (without_key, {})]:
        try:
            urllib.request.urlopen(urllib.request.Request(url, headers=headers))
        except urllib.error.HTTPError as error:
            assert error.code == 403, error
        else:
            raise AssertionError(f"{url} with {headers} should be refused")


def check_material(page, box, pictures):
    """A click chooses the material, sliders change it, and undo takes a whole drag back."""
    page.mouse.click(box["x"] + 0.58 * box["width"], box["y"] + 0.5 * box["height"])
    wait_for(page, "!document.getElementById('material-fields').hidden", "the material's values")
    before = page.locator("#base_color").input_value()
    page.locator("#base_color").fill("#2040c0")
    wait_for(page, "document.getElementById('toml').value.includes('color = [')", "the changes as lines")
    page.locator("#roughness").focus()
    page.keyboard.press("ArrowLeft")
    wait_for(page, "document.getElementById('roughness-value').textContent === '0.99'", "a slider moved by keys")
    page.locator("#roughness").scroll_into_view_if_needed()
    pictures(page, "material")
    while page.locator("#undo").is_enabled():
        page.keyboard.press("Control+z")
        page.wait_for_timeout(200)
    wait_for(page, "document.getElementById('toml').value === ''", "nothing is changed any more")
    wait_for(page, f"document.getElementById('base_color').value === '{before}'", "the colour as it was")


def check_lamp(page):
    """The lamp's slider and colour change it, and undo takes that back."""
    shown = "document.getElementById('scene-light-strength-value').textContent"
    before = page.evaluate(shown)
    assert before == "7.96 W/sr", before
    page.locator("#scene-light-strength").fill("1")
    wait_for(page, f"{shown} === '15.9 W/sr'", "a lamp of twice the strength")
    page.locator("#scene-light-color").fill("#ff8040")
    wait_for(page, "document.getElementById('toml').value.includes('color = [1.0, ')", "the lamp's colour as a line")
    page.locator("#scene-light-strength").fill("-8")
    wait_for(page, f"{shown} === 'off'", "a lamp that is off")
    while page.locator("#undo").is_enabled():
        page.keyboard.press("Control+z")
        page.wait_for_timeout(200)
    wait_for(page, f"{shown} === '{before}'", "the lamp as it was")


def check_panel(page, pictures):
    """Denoising, passes, outlines, the help, and what screen readers announce."""
    page.locator("#denoise").check()
    wait_for(page, "document.body.dataset.denoised > 100", "a denoised picture")
    unnamed = page.evaluate("""() => [...document.querySelectorAll("button, a, input, select, textarea, canvas, progress")]
      .filter((e) => e.checkVisibility() && !(e.labels?.length || e.ariaLabel || e.textContent.trim() || e.closest("button")))
      .map((e) => e.outerHTML)""")
    assert not unnamed, f"controls without a name: {unnamed}"
    wait_for(page, "document.querySelector('#thumbnails button:nth-child(3) canvas').width > 100", "small pictures")
    page.locator("#thumbnails button").nth(2).click()
    wait_to_see(page, lambda seen: abs(seen["mean"][0] - 127.5) < 30, "normals by their small picture")
    page.keyboard.press("Shift+P")
    page.locator("#thumbnails button").first.click()
    wait_for(page, "document.getElementById('pass').value === ''", "colour again")
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + 0.58 * box["width"], box["y"] + 0.5 * box["height"])
    wait_for(page, "document.getElementById('outline').getAttribute('d')?.length > 100", "an outline")
    pictures(page, "outline")
    page.keyboard.press("o")
    wait_for(page, "!document.getElementById('outline').getAttribute('d')", "no outline")
    check_material(page, box, pictures)
    check_lamp(page)
    page.keyboard.press("d")
    wait_for(page, "!document.getElementById('denoise').checked && document.body.dataset.denoised === '0'", "noise")
    page.keyboard.press("?")
    assert page.evaluate("document.getElementById('help').open"), "the help opens"
    page.keyboard.press("Escape")
    page.set_viewport_size({"width": 390, "height": 844})
    width = page.locator("#picture").bounding_box()["width"]
    assert width > 380 and page.evaluate("document.documentElement.scrollWidth") == 390, f"a phone's screen: {width}"
    pictures(page, "phone")
    page.set_viewport_size({"width": 1280, "height": 720})


def check(page, other, program, pictures):
    start = time.monotonic()
    page.goto(program.address)
    wait_for(page, "document.body.dataset.version > 0", "a first picture")
    print(f"first picture after {time.monotonic() - start:.2f} s, page and all")
    page.locator("#denoise").uncheck()
    wait_for(page, "document.body.dataset.denoised === '0' && document.body.dataset.samples >= 1", "a whole picture")
    first = page.evaluate(LOOK)
    assert first["mean"][2] > 100, f"a light sky: {first}"
    samples = float(page.evaluate("document.body.dataset.samples"))
    wait_for(page, f"document.body.dataset.samples > {samples} + 8", "more samples")
    refined = page.evaluate(LOOK)
    assert refined["changed"] > 100, f"it refines: {refined}"
    wait_for(page, "document.body.dataset.finished === 'true'", "all samples")
    pictures(page, "page")

    check_panel(page, pictures)
    other.goto(program.address)
    wait_for(other, "document.body.dataset.finished === 'true'", "a second page shows the same")

    page.evaluate(LOOK)
    box = page.locator("#picture").bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*middle)
    wait_for(page, "document.getElementById('probe').textContent.includes(' m')", "values under the mouse")
    page.mouse.down()
    version = int(page.evaluate("document.body.dataset.version"))
    start = time.monotonic()
    page.mouse.move(middle[0] + 60, middle[1] + 20, steps=4)
    wait_for(page, f"document.body.dataset.version > {version} + 1", "turning shows another picture")
    print(f"a picture {time.monotonic() - start:.2f} s after the camera was turned")
    page.mouse.up()
    wait_for(page, "document.body.dataset.finished === 'true'", "the turned picture refines")
    turned = page.evaluate(LOOK)
    assert turned["changed"] > 1000, f"turning changes the picture: {turned}"
    wait_for(other, "document.getElementById('command').value.includes('--eye')", "the other page follows")
    command = page.input_value("#command")
    assert "--eye" in command and "--target" in command, command

    page.locator("#pass").select_option("normal")
    wait_to_see(page, lambda seen: all(abs(v - 127.5) < 30 for v in seen["mean"]), "normals are grey on average")
    page.locator("#pass").select_option("")
    page.locator("#exposure").fill("-3")
    wait_to_see(page, lambda seen: seen["mean"][2] < 0.7 * turned["mean"][2], "less exposure is darker")
    page.locator("#exposure").fill("0")

    program.scene.write_text(SCENE.replace("[0.8, 0.1, 0.1]", "[0.1, 0.8, 0.1]").replace("radius = 0.5", "radius = 1.5"))
    wait_to_see(page, lambda seen: seen["mean"][1] > seen["mean"][0] + 20, "a large green ball for a small red one")
    program.scene.write_text("[camera\n")
    wait_for(page, "!document.getElementById('error-message').hidden", "a broken scene is reported")
    pictures(page, "trouble")
    program.scene.write_text(SCENE)
    wait_for(page, "document.getElementById('error-message').hidden", "a mended scene is shown")

    for name, signature in [("EXR", b"\x76\x2f\x31\x01"), ("PNG", b"\x89PNG")]:
        with page.expect_download() as download:
            page.get_by_text(f"Save {name}").click()
        assert pathlib.Path(download.value.path()).read_bytes().startswith(signature), name


def main():
    shots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None

    def pictures(page, name):
        if shots:
            page.screenshot(path=str(shots / f"view-{name}.png"))

    folder = tempfile.mkdtemp()
    program = Program(sys.argv[1], folder)
    try:
        check_hosts(program.address)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SWITCHES)
            page, other = (browser.new_page(viewport={"width": 1280, "height": 720}) for _ in range(2))
            errors = []
            page.on("pageerror", lambda error: errors.append(str(error)))
            check(page, other, program, pictures)
            assert not errors, errors
            browser.close()
        program.end()
    finally:
        program.process.kill()
        shutil.rmtree(folder)
    print("all is well")


if __name__ == "__main__":
    main()
