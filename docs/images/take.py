"""Takes the pictures of the README anew: what `truepath demo` writes, as a browser shows it on a laptop.

    .venv/bin/python docs/images/take.py [FOLDER OF A DEMO]

Without a folder the demo is run first. Needs Chromium, as the tests of the pages do.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

HERE = Path(__file__).parent
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPTIONS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader"]  # draws without a graphics card
LAPTOP = {"width": 1366, "height": 768}
SETTLED_MS = 6000  # shapes are decoded and drawn by then
COLOURS = 256
LARGEST_BYTES = 300_000


def take(browser: Browser, page: Path, picture: Path) -> None:
    tab = browser.new_page(viewport=LAPTOP)
    tab.goto(page.resolve().as_uri())
    tab.wait_for_timeout(SETTLED_MS)
    image = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
    tab.close()
    image.quantize(COLOURS).save(picture, optimize=True)
    size = picture.stat().st_size
    print(f"{picture.name}: {image.width} x {image.height}, {size // 1000} kB")
    if size > LARGEST_BYTES:
        raise SystemExit(f"{picture.name} is larger than {LARGEST_BYTES // 1000} kB")


def take_all(demo: Path) -> None:
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    if executable is None:
        raise SystemExit("no browser found: looked for " + ", ".join(BROWSERS))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=executable, args=OPTIONS)
        for name in ("preview", "report"):
            take(browser, demo / f"{name}.html", HERE / f"{name}.png")
        browser.close()


def main() -> None:
    if len(sys.argv) > 1:
        take_all(Path(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory() as folder:
        command = Path(sys.executable).with_name("truepath")
        subprocess.run([command, "demo", "--folder", folder], check=True)
        take_all(Path(folder))


if __name__ == "__main__":
    main()
