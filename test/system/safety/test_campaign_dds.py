"""The fault campaign over DDS with real node processes: it holds, and its monitor can fail."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from slip_bags.reader import Bag
from test.campaigns.faults import pair
from test.campaigns.faults.campaign import Tally
from test.campaigns.faults.dds_campaign import run_over_dds
from test.campaigns.faults.plan import CONTROLLER, EFFORT, JOINT, SLIP, WRENCH, all_faults_over_dds

SEED = 3
CASES = all_faults_over_dds()


@pytest.fixture(autouse=True)
def _own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


def run(tmp_path: Path, *cases: tuple[str, str], two_arms: bool = False, effort_rate: float | None = None) -> Tally:
    every = pair.CASES_OVER_DDS if two_arms else CASES
    tally, trials = Tally(SEED, over_dds=True, two_arms=two_arms), [every.index(case) for case in cases]
    run_over_dds(tally, trials, tmp_path, lambda _: None, effort_rate=effort_rate)
    return tally


def test_promise_holds_while_messages_are_damaged_and_the_controller_is_killed_and_stopped(tmp_path: Path) -> None:
    """In three settings: of scenario, law and sensor; the controller comes back in motion without a step."""
    cases = [("corrupt_values", JOINT), ("kill", CONTROLLER), ("stop", CONTROLLER), ("bad_parameter", CONTROLLER)]
    tally = run(tmp_path, *cases)
    assert [verdict.violations for verdict in tally.verdicts] == [()] * len(cases)
    assert all(verdict.commands > 0 for verdict in tally.verdicts)
    assert tally.notes["process_starts"] >= 3
    assert len({verdict.setting for verdict in tally.verdicts}) == 3
    summary = json.loads((tmp_path / "faults.json").read_text())
    assert {"trials", "violations", "bound_95", "by_fault"} <= set(summary)
    assert (summary["trials"], summary["violations"], summary["over_dds"]) == (len(cases), 0, True)
    assert {f"{kind} {target}" for kind, target in cases} <= set(summary["by_fault"])


def test_promise_holds_with_two_arms(tmp_path: Path) -> None:
    """Both arms stop together, whatever is wrong with one of them, and no command steps."""
    cases = [("drop", f"left/{JOINT}"), ("corrupt_values", f"right/{WRENCH}"), ("second_publisher", f"right/{EFFORT}")]
    tally = run(tmp_path, *cases, two_arms=True)
    assert [verdict.violations for verdict in tally.verdicts] == [()] * len(cases)
    assert all(verdict.commands > 0 for verdict in tally.verdicts)
    assert {verdict.setting.split()[0] for verdict in tally.verdicts} == set(pair.SCENARIOS)


# By hand: on a loaded machine a trial may judge too few commands; with one trial 2 of 6 runs found nothing to say.
@pytest.mark.long
def test_a_stricter_promise_than_the_gate_keeps_is_caught_and_leaves_a_bag(tmp_path: Path) -> None:
    """With a slope that moving needs: what the controller does lawfully must then be a violation."""
    cases = [("bad_parameter", CONTROLLER), ("drop", SLIP), ("kill", CONTROLLER)]
    verdict = run(tmp_path, *cases, effort_rate=0.5).failed[0]
    assert any("effort steps" in text for text in verdict.violations)
    with Bag(tmp_path / f"trial_dds_{SEED}_{verdict.trial}") as bag:
        assert bag.topics["/effort_command"].message_count >= 2  # a step has two ends
        assert "effort steps" in bag.custom_data["violations"]
