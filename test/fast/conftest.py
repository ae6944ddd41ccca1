"""The fast tier: no process, no DDS. What starts one is stopped here, with the name of what it started."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from test.support.no_processes import forbidden


@pytest.fixture(autouse=True)
def _no_process_and_no_dds() -> Iterator[None]:
    with forbidden():
        yield
