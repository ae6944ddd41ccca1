"""Two systems in one domain, each in its own namespace, do what each does alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from slip_bags.reader import Bag
from slip_bringup.domain import domain_id
from slip_bringup.processes import child_environment

DEADLINE_S = 150.0
SIDES = ("left", "right")


def efforts(bag: Path, namespace: str) -> np.ndarray:
    with Bag(bag) as opened:
        return np.array([message.value.effort for message in opened.messages(f"{namespace}/effort_command")])


def names_in_diagnostics(bag: Path) -> set[str]:
    with Bag(bag) as opened:
        return {status.name for message in opened.messages("/diagnostics") for status in message.value.status}


def test_two_namespaces_do_not_disturb_each_other(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "slip_bringup.cli", "run", "--set", "bridge.duration_s=0.2", "--record"]
    with domain_id(None) as domain:
        alone = [*command, str(tmp_path / "alone"), "--domain-id", str(domain)]
        subprocess.run(alone, env=child_environment(domain), check=True, timeout=DEADLINE_S, stdout=subprocess.DEVNULL)
        runs = [
            subprocess.Popen(
                [*command, str(tmp_path / side), "--namespace", side, "--domain-id", str(domain)],
                env=child_environment(domain), stdout=subprocess.DEVNULL,
            )
            for side in SIDES
        ]  # fmt: skip
        assert [run.wait(DEADLINE_S) for run in runs] == [0, 0]
    expected = efforts(tmp_path / "alone", "")
    assert len(expected) == 200
    for side in SIDES:
        assert (efforts(tmp_path / side, f"/{side}") == expected).all()
    seen = set().union(*(names_in_diagnostics(tmp_path / side) for side in SIDES))
    assert {f"{side}/slip_vic_controller: mode" for side in SIDES} <= seen
    assert not any(name.startswith("slip_vic_controller") for name in seen)
