"""What went wrong is said by the real processes, in a line each, with exit code 1."""

from __future__ import annotations

import pytest

from test.support.command import slip_vic

SHORT = ("--set", "bridge.duration_s=0.3")


def test_a_fault_is_said() -> None:
    done = slip_vic(
        "run", "--scenario", "glass_transport", "--law", "vic", "--set", "controller.gains.spin=follow", *SHORT
    )
    assert done.returncode == 1
    (said,) = [line for line in done.stderr.splitlines() if line.startswith("FAULT at 0.")]
    assert "the limit is" in said


@pytest.mark.smoke
def test_a_run_that_goes_well_says_nothing_but_how_far_it_is() -> None:
    done = slip_vic("run", *SHORT)
    assert done.returncode == 0
    assert [line for line in done.stderr.splitlines() if not line.startswith("paper_planar governed: ")] == []
