"""Chromium for tests: found where it is installed, driven by playwright, without network."""

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Error, Page, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
SWITCHES = (
    "--no-sandbox",
    "--use-angle=swiftshader",  # WebGL without a GPU
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
LONGEST_S = 60.0
POLL_MS = 20.0


def executable() -> str:
    """Return the browser's path; skips the test where none is installed."""
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium: install it (apt install chromium) or set CHROMIUM=/path/to/it")
    return found


@contextmanager
def chromium() -> Iterator[Browser]:
    """Start the browser; only one at a time can be open in a thread."""
    path = executable()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(SWITCHES))
        try:
            yield browser
        finally:
            browser.close()


def open_page(browser: Browser, address: str, *, ready: bool = True, **options: Any) -> tuple[Page, list[str]]:
    """Open a page in a new window and wait until it is built; return it with the list that its errors go to."""
    page = browser.new_page(**{"viewport": {"width": 1440, "height": 1000}, **options})
    errors: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("requestfailed", lambda request: errors.append(request.url))
    page.goto(address)
    if ready:
        wait_until(page, "document.body.dataset.ready !== undefined")
    return page, errors


def wait_until(page: Page, condition: str) -> None:
    """Wait until a script gives true; the page forbids the `eval` that playwright's own waiting needs."""
    end = time.monotonic() + LONGEST_S
    while not _holds(page, condition):
        assert time.monotonic() < end, f"never true: {condition}"
        page.wait_for_timeout(POLL_MS)


def _holds(page: Page, condition: str) -> bool:
    try:
        return bool(page.evaluate(condition))
    except Error as error:
        if "context was destroyed" not in str(error):
            raise
        return False  # the page is loaded anew


def address_of(path: Path) -> str:
    """Return the address of a file on disk."""
    return path.resolve().as_uri()
