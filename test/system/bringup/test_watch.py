"""`slip-vic watch` in a real browser, fed by a bag that is played in a namespace."""

import re
import signal
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from slip_bags.reader import Bag
from slip_vic.run.domain import domain_id
from test.support.browser import open_page
from test.support.browser import wait_until as wait_in_page
from test.support.ros import Processes, wait_until
from test.support.two_arms import copy_bag

BAG = Path(__file__).parents[3] / "bags" / "paper_planar_classical"
NAMESPACE = "left"
FRAMES = 10
LASTS_S = 34.0  # time in which the bag is played, however long it was recorded: a page drawn late still sees the run


def start_watch(processes: Processes, *arguments: object) -> tuple[object, str]:
    child = processes.python("watch", "-m", "slip_vic.cli", "watch", "--port", 0, *arguments)
    wait_until(lambda: "http://" in child.tail() or child.poll() is not None, "the address", seen=child.tail)
    found = re.search(r"http://\S+", child.tail())
    assert found is not None, child.tail()
    return child, found[0]


def start_player(processes: Processes, folder: Path, *how: object) -> object:
    """Play the bag's topics in a namespace, slowly."""
    bag = Bag(BAG)
    names = [name for name in bag.topics if name not in ("/clock", "/diagnostics", "/tf")]
    assert bag.span_ns is not None
    rate = 1e-9 * (bag.span_ns[1] - bag.span_ns[0]) / LASTS_S
    copy_bag(BAG, folder, {name: [f"/{NAMESPACE}{name}"] for name in names})
    return processes.python("player", "-m", "slip_bags.cli", "play", folder, "--rate", rate, *how)


def test_page_follows_what_runs(processes: Processes, browser: Browser, tmp_path: Path) -> None:
    child, address = start_watch(processes)
    page, errors = open_page(browser, address, ready=False)
    assert "Waiting for joint states" in page.inner_text("#problem")
    player = start_player(processes, tmp_path / "bag")
    wait_in_page(page, f"(window.slipPage?.plots.model.count ?? 0) > {FRAMES}")
    wait_in_page(page, "document.getElementById('problem').hidden")
    assert page.evaluate("slipPage.plots.model.runs[0].arms.map(arm => arm.name)") == [NAMESPACE]
    assert page.evaluate("slipPage.player.end") > 0.0
    bag = Bag(BAG)
    states = bag.series("joint_states")["position"]
    q = page.evaluate("Array.from(slipPage.plots.model.runs[0].arms[0].q.slice(0, 7))")
    assert min(abs(states - q).max(axis=1)) < 1e-6, "not a posture of the bag"
    wait_in_page(page, "document.querySelector('.run .mode').innerText === 'ACTIVE'")
    processes.stop(player, signal.SIGINT)
    wait_in_page(page, "!document.getElementById('problem').hidden")
    assert "the run has ended" in page.inner_text("#problem")
    late, _ = open_page(browser, address)
    assert "the run has ended" in late.inner_text("#problem")
    assert errors == []
    assert processes.stop(child, signal.SIGINT) == 0


def test_page_begins_again_with_a_bag_that_is_looped(processes: Processes, browser: Browser, tmp_path: Path) -> None:
    _, address = start_watch(processes)
    page, errors = open_page(browser, address, ready=False)
    start_player(processes, tmp_path / "bag", "--loop")
    wait_in_page(page, f"(window.slipPage?.plots.model.count ?? 0) > {FRAMES}")
    page.evaluate("window.latest = 0")  # gone where the page is loaded anew
    wait_in_page(page, "(latest = Math.max(latest, slipPage.player.end)) > slipPage.player.end")
    wait_in_page(page, f"slipPage.plots.model.count > {FRAMES}")
    page.evaluate("slipPage.player.pause()")
    assert page.evaluate("slipPage.player.t <= slipPage.player.end")
    times = page.evaluate("Array.from(slipPage.plots.model.time.slice(0, slipPage.plots.model.count))")
    assert times == sorted(times)
    assert page.inner_text(".run .mode") == "ACTIVE"
    assert errors == []


def test_address_is_local_and_serves_the_page_alone(processes: Processes) -> None:
    child, address = start_watch(processes)
    assert address.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(address) as answer:
        assert b"slip-vic watch" in answer.read()
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{address}etc/passwd")
    port = address.rstrip("/").rpartition(":")[2]
    second = processes.python("second", "-m", "slip_vic.cli", "watch", "--port", port)
    assert processes.wait_end(second) == 2
    assert "a free port; choose another" in second.tail()
    assert processes.stop(child, signal.SIGINT) == 0


def test_it_shows_the_newest_run(processes: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where runs are noted is a folder of this test alone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with domain_id() as domain:
        command = ("-m", "slip_vic.cli", "watch", "--port", 0)
        child = processes.python("watch", *command, ROS_DOMAIN_ID="", XDG_CACHE_HOME=str(tmp_path))
        line = f"watching ROS domain {domain} for a run of slip-vic"
        wait_until(lambda: line in child.tail(), line, seen=child.tail)
    assert processes.stop(child, signal.SIGINT) == 0
