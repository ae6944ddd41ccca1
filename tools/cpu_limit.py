"""A pytest plugin for tools/mutate: a test that needs more processor time than CPU_LIMIT_S says fails.

The report has the processor time of each test, which does not depend on what else the machine does.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Generator
from typing import Any

import pytest

LIMIT = "CPU_LIMIT_S"
OVER = "needs more processor time than it may"


def _over(*_: object) -> None:
    pytest.fail(OVER, pytrace=False)  # where the signal comes there may be no line number, and pytest needs one


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: Any) -> Generator[None, Any, Any]:
    """Run a test under the limit."""
    began_s = time.process_time()
    signal.signal(signal.SIGPROF, _over)
    signal.setitimer(signal.ITIMER_PROF, float(os.environ[LIMIT]))
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        pyfuncitem.user_properties.append(("cpu_s", time.process_time() - began_s))
