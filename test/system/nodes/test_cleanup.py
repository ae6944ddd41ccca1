"""A cleaned-up controller, checked in a process of its own: a node on rclpy's default context spoils later ones."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

CHECKS = Path(__file__).with_name("cleanup_checks.py")
CHECKED = 3
TIMEOUT_S = 120.0


def test_cleanup_removes_own_endpoints() -> None:
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(CHECKS)]
    root = CHECKS.parents[3]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert done.returncode == 0, done.stdout
    assert f"{CHECKED} passed" in done.stdout
