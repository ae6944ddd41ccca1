"""Chromium for tests: found where it is installed, driven by playwright, without network."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, sync_playwright

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
READY_MS = 60_000


def executable() -> str:
    """Return the browser's path; skips the test where none is installed."""
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium: install it (apt install chromium) or set CHROMIUM=/path/to/it")
    return found


@contextmanager
def browser_context(**options: object) -> Iterator[BrowserContext]:
    """Open a new, empty browser window without network."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable(), args=list(SWITCHES))
        try:
            yield browser.new_context(**{"offline": True, "viewport": {"width": 1440, "height": 1000}, **options})
        finally:
            browser.close()


def open_page(context: BrowserContext, address: str) -> tuple[Page, list[str]]:
    """Open a page and wait until it is built; return it with the list that its errors go to."""
    page = context.new_page()
    errors: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("requestfailed", lambda request: errors.append(request.url))
    page.goto(address)
    page.wait_for_function("document.body.dataset.ready", timeout=READY_MS)
    return page, errors


def address_of(path: Path) -> str:
    """Return the address of a file on disk."""
    return path.resolve().as_uri()
