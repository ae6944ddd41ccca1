"""The demo's page in a real browser: from disk, without network; screenshots are kept in SLIP_VIC_ARTEFACTS."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from slip_bags.reader import Bag
from test.support.browser import address_of, open_page, wait_until
from test.system.conftest import DEMO_S

MIDDLE_S = 0.9
MOST_BYTES = 5_000_000
POSITION_TOLERANCE_M = 1e-6  # poses are float32
FRAME_S = DEMO_S / 2000
FEWEST_COLOURS = 50


@pytest.fixture(scope="module")
def opened(browser: Browser, demo: tuple[Path, str]) -> tuple[Page, list[str], Path]:
    page, errors = open_page(browser, address_of(demo[0] / "report.html"), offline=True)
    return page, errors, demo[0]


def shot(page: Page, name: str, *, whole: bool = False) -> None:
    folder = Path(os.environ.get("SLIP_VIC_ARTEFACTS", "out/screenshots"))
    folder.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=folder / f"{name}.png", full_page=whole)


def go(page: Page, time_s: float) -> None:
    page.eval_on_selector("#slider", "(s, t) => { s.value = t; s.dispatchEvent(new Event('input')); }", time_s)
    wait_until(page, "+document.body.dataset.frame === window.slipPage.player.frameAt(window.slipPage.player.t)")


def shown(page: Page, run: str, name: str) -> float:
    return float(page.inner_text(f'.run[data-run="{run}"] [data-value="{name}"]'))


def picture(page: Page, run: str, view: str) -> tuple[int, str]:
    """Return how many colours a canvas shows, and its content."""
    script = """canvas => {
        const pen = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", {willReadFrequently: true});
        pen.drawImage(canvas, 0, 0);
        const pixels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
        return [new Set(new Uint32Array(pixels.buffer)).size, canvas.toDataURL()];
    }"""
    colours, content = page.eval_on_selector(f'.run[data-run="{run}"] .{view}', script)
    return colours, content


def test_page_is_whole_small_and_without_errors(opened: tuple[Page, list[str], Path]) -> None:
    page, errors, out = opened
    assert errors == []
    assert not page.is_visible("#problem")
    assert (out / "report.html").stat().st_size < MOST_BYTES
    assert [card.get_attribute("data-run") for card in page.query_selector_all(".run")] == [
        "classical",
        "vic",
        "governed",
        "governed_follow",
    ]
    names = {card.get_attribute("data-plot") for card in page.query_selector_all(".plot")}
    assert {"slip_mm", "slip_deg", "slip_speed", "error_mm", "stiffness", "gate", "load", "effort", "mode"} <= names


def test_numbers_at_the_end_are_those_of_the_summary(opened: tuple[Page, list[str], Path]) -> None:
    page, _, out = opened
    runs = json.loads((out / "summary.json").read_text())["runs"]
    go(page, page.evaluate("window.slipPage.player.end"))
    shot(page, "demo_end", whole=True)
    table = page.eval_on_selector_all(
        "#summary tr", "rows => rows.map(row => [...row.cells].map(cell => cell.innerText))"
    )
    rows = {row[0]: row[1:] for row in table}
    for column, (name, run) in enumerate(runs.items()):
        assert shown(page, name, "slip_mm") == round(1e3 * run["slip_linear_m"], 2)
        assert shown(page, name, "slip_deg") == round(float(np.degrees(run["slip_angular_rad"])), 2)
        assert rows["slip at the end [mm]"][column] == f"{1e3 * run['slip_linear_m']:.2f}"
        assert rows["peak effort [N m]"][column] == f"{run['effort_peak_nm']:.1f}"


def test_slider_moves_picture_and_numbers(opened: tuple[Page, list[str], Path]) -> None:
    page, errors, out = opened
    go(page, 0.0)
    before = [picture(page, "classical", view) for view in ("arm", "grasp")]
    assert all(colours > FEWEST_COLOURS for colours, _ in before), "a blank picture"
    assert shown(page, "classical", "slip_mm") == 0.0
    go(page, MIDDLE_S)
    shot(page, "demo_middle")
    after = [picture(page, "classical", view) for view in ("arm", "grasp")]
    assert all(a != b for (_, a), (_, b) in zip(before, after, strict=True))
    bag = Bag(out / "classical")
    truth = bag.series("slip_truth")
    row = int(np.searchsorted((truth.stamps - truth.stamps[0]) * 1e-9, MIDDLE_S - FRAME_S))
    near = 1e3 * np.linalg.norm(truth["position"][row : row + 5, :3], axis=1)  # the frame is at most one step older
    assert near.min() - 0.01 <= shown(page, "classical", "slip_mm") <= near.max() + 0.01
    assert errors == []


def test_the_drawn_arm_is_where_the_controller_says(opened: tuple[Page, list[str], Path]) -> None:
    page, _, out = opened
    bag = Bag(out / "vic")
    poses = bag.series("controller/ee_pose")
    go(page, float((poses.stamps[-1] - poses.stamps[0]) * 1e-9) + FRAME_S)
    drawn = page.evaluate("Array.from(window.slipPage.scenes[1].arms[0].robot.tip.matrixWorld.elements).slice(12, 15)")
    recorded = [poses[f"pose.position.{axis}"][-1] for axis in "xyz"]
    np.testing.assert_allclose(drawn, recorded, atol=10 * POSITION_TOLERANCE_M)


def test_keys_play_and_zoom(opened: tuple[Page, list[str], Path]) -> None:
    page, errors, _ = opened
    page.keyboard.press("Home")
    assert page.evaluate("window.slipPage.player.t") == 0.0
    page.keyboard.press("ArrowRight")
    assert page.evaluate("window.slipPage.player.t") == pytest.approx(0.02)
    page.keyboard.press("Space")
    wait_until(page, "window.slipPage.player.t > 0.1")
    page.keyboard.press("Space")
    assert not page.evaluate("window.slipPage.player.playing")
    limits = "window.slipPage.plots.all.map(own => [own.u.scales.x.min, own.u.scales.x.max])"
    page.evaluate("window.slipPage.plots.all[0].u.setScale('x', {min: 1, max: 2})")
    assert page.evaluate(limits) == [[1, 2]] * len(page.query_selector_all(".plot"))
    page.keyboard.press("t")
    assert page.get_attribute("html", "data-theme") == "dark"
    assert errors == []


SCREENS: dict[str, dict[str, Any]] = {
    "laptop_dark": {"viewport": {"width": 1024, "height": 768}, "color_scheme": "dark"},
    "phone": {
        "viewport": {"width": 390, "height": 844},
        "device_scale_factor": 2,
        "is_mobile": True,
        "has_touch": True,
    },
}


LOWEST_NUMBER = "Math.max(...[...document.querySelectorAll('.readouts')].map(e => e.getBoundingClientRect().bottom))"
FARTHEST = """Math.max(...slipPage.scenes.flatMap(scene => scene.arms.flatMap(own => own.robot.links.flatMap(link => {
    const seen = link.getWorldPosition(slipPage.views.target.clone()).project(slipPage.views.camera);
    return [Math.abs(seen.x), Math.abs(seen.y)];
}))))"""
"""How far from the middle of the picture a link is, 1 at its edge."""


@pytest.mark.parametrize("name", SCREENS)
def test_page_fits_the_screen(browser: Browser, demo: tuple[Path, str], name: str) -> None:
    page, errors = open_page(browser, address_of(demo[0] / "report.html"), offline=True, **SCREENS[name])
    shot(page, name, whole=True)
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    if not SCREENS[name].get("is_mobile"):
        assert page.evaluate(LOWEST_NUMBER) <= page.evaluate(
            "document.querySelector('#player').getBoundingClientRect().top"
        )
    for time_s in (0.0, MIDDLE_S):
        go(page, time_s)
        assert page.evaluate(FARTHEST) < 1.0, "a link is out of the picture"
    assert errors == []
    page.close()
