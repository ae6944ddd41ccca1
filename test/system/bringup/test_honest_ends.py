"""What went wrong is said by the real processes, in a line each, with exit code 1."""

from __future__ import annotations

import pytest

from test.system.bringup.test_cli import slip_vic

PRINTED = ("--scenario", "glass_transport", "--law", "vic", "--set", "controller.gains.spin=follow")
REFUSED = ("--scenario", "vertical_plane", "--set", "controller.governor.margin=0.95")


@pytest.mark.parametrize(
    ("words", "kind", "reason"),
    [
        ((*PRINTED, "--set", "bridge.duration_s=0.3"), "FAULT", "the limit is"),
        ((*REFUSED, "--set", "bridge.duration_s=0.3", "--in-process"), "UNREACHABLE", "at 800 ms of the path"),
    ],
    ids=["fault", "refused path"],
)
def test_what_the_controller_gave_up_for_is_said(words: tuple[str, ...], kind: str, reason: str) -> None:
    done = slip_vic("run", *words)
    assert done.returncode == 1
    said = [line for line in done.stderr.splitlines() if line.startswith(f"{kind} at 0.")]
    assert len(said) == 1
    assert reason in said[0]


@pytest.mark.smoke
def test_a_run_that_goes_well_says_nothing() -> None:
    done = slip_vic("run", "--set", "bridge.duration_s=0.3")
    assert done.returncode == 0
    assert [line for line in done.stderr.splitlines() if not line.endswith(" done")] == []  # progress, where it is slow
