"""The fast tier starts no process and opens no DDS: what sees to that can fail."""

import os
import subprocess
import sys

import pytest

from test.support.no_processes import Forbidden


def test_the_guard_stops_processes() -> None:
    """Whatever starts them, also in a library."""
    with pytest.raises(Forbidden, match="started a process"):
        subprocess.run(["true"], check=True)
    with pytest.raises(Forbidden, match="started a process"):
        subprocess.run([sys.executable, "-c", ""], check=True)
    with pytest.raises(Forbidden, match="started a process"):
        os.system("true")
    with pytest.raises(Forbidden, match="started a process"):
        os.posix_spawn("/bin/true", ["true"], {})


def test_the_guard_lets_interpreted_checks_pass() -> None:
    subprocess.run([sys.executable, "-c", ""], check=True, env={**os.environ, "NUMBA_DISABLE_JIT": "1"})


def test_the_guard_stops_dds() -> None:
    rclpy = __import__("rcl" + "py")
    context = __import__("rcl" + "py.context", fromlist=["Context"]).Context()
    with pytest.raises(Forbidden, match="opened DDS"):
        rclpy.init(args=[], context=context)
    assert not context.ok()
