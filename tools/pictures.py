"""Take the pictures of the page of a run in docs/pictures: from runs in process, by a browser.

python tools/pictures.py                                    those of built-in scenarios
python tools/pictures.py SCENARIO.yaml SECONDS DRIVE NAME   one of an own scenario, page_NAME.png
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

import slip_vic
from slip_vic.page.page import write_page
from test.support.browser import address_of, chromium, open_page

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
SCENARIOS = {"paper_planar": 8.0, "pane_two_arms_fast": 0.47}  # and the time that is shown [s]
SIZE = {"width": 1300, "height": 820}
COLOURS = 64


def take(scenario: str, at_s: float, folder: Path, drive: str = "", name: str = "") -> None:
    """Run a scenario under the three laws and take the picture of its page."""
    loaded = slip_vic.load(scenario, drive=drive)
    runs = {law: slip_vic.load(scenario, law=law, drive=drive).run().data for law in ("classical", "vic", "governed")}
    page = folder / "page.html"
    write_page(page, runs, command="python tools/pictures.py", description=loaded.description)
    with chromium() as browser:
        opened, _ = open_page(browser, address_of(page), viewport=SIZE)
        opened.evaluate("t => { slider.value = t; slider.dispatchEvent(new Event('input')); }", at_s)
        opened.wait_for_timeout(500.0)
        opened.screenshot(path=folder / "page.png")
    picture = Image.open(folder / "page.png").convert("RGB").quantize(COLOURS)
    picture.save(PICTURES / f"page_{name or scenario}.png", optimize=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        if len(sys.argv) > 1:
            take(sys.argv[1], float(sys.argv[2]), Path(made), *sys.argv[3:])
        else:
            for scenario, at_s in SCENARIOS.items():
                take(scenario, at_s, Path(made))
