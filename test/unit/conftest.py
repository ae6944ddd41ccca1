"""The fast tier: no process, no DDS. What starts one is stopped here, with the name of what it started."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from typing import Final

import pytest

from test.support.no_processes import forbidden

KERNELS: Final = ("slip_vic_controller.session.session", "test.referees.governor_bench")


def pytest_sessionstart() -> None:
    """Compile what is not compiled yet: workers begin at opposite ends, and load what the other has made."""
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is not None:
        for name in KERNELS if worker[-1] in "02468" else reversed(KERNELS):
            importlib.import_module(name)


@pytest.fixture(autouse=True)
def _no_process_and_no_dds() -> Iterator[None]:
    with forbidden():
        yield
