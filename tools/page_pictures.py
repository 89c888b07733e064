"""The page as it looks in a browser, light and dark: for tools/pictures.py."""

import io
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image

from flight import InputError

NAMES = ("ground_station",)
SIZE = {"width": 1440, "height": 900}
FLAGS = ("--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""3D without a graphics card."""
PATIENCE_MS = 300_000
_ADDRESS = re.compile(r"https?://\S+/\?token=\S+")


def shots(demo: Path, name: str) -> Iterator[tuple[str, Image.Image]]:
    """Name and image of the step Plan in both styles.

    Raises:
        InputError: there is no Chromium.
    """
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium")
    if chromium is None:
        raise InputError("pictures of the page need Chromium: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS), timeout=PATIENCE_MS)
        for style in ("light", "dark"):
            with served(demo) as address:
                page = browser.new_page(viewport=SIZE, color_scheme=style, reduced_motion="reduce")
                page.set_default_timeout(PATIENCE_MS)
                page.goto(address)
                page.get_by_text("Checked", exact=True).wait_for()
                page.wait_for_load_state("networkidle")
                page.wait_for_timeout(20_000)  # the mesh comes in pieces, and nothing on the page says when it is whole
                yield f"{name}_{style}", Image.open(io.BytesIO(page.screenshot()))
                page.close()
        browser.close()


@contextmanager
def served(demo: Path) -> Iterator[str]:
    """The address of a ground station with the demo's project."""
    command = [sys.executable, "-u", "-m", "goshawk", "gcs", str(demo), "--port", "0"]
    station = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert station.stdout is not None
    try:
        for line in station.stdout:
            if address := _ADDRESS.search(line):
                yield address[0]
                return
        raise InputError(f"goshawk gcs {demo} ended without an address; run it by hand to see why")
    finally:
        station.terminate()
        station.wait()
