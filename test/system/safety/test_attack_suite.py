"""The attack suite on real nodes: a few of its attacks, and a monitor that can fail."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from test.campaigns.faults import attack_suite
from test.campaigns.faults.attack_suite import run_attacks
from test.campaigns.faults.attacks import ATTACKS
from test.campaigns.faults.dds_campaign import campaign_of

pytestmark = pytest.mark.long


@pytest.fixture(autouse=True)
def _own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


def test_the_promise_is_kept_under_attack_and_the_table_says_so(tmp_path: Path) -> None:
    names = [
        "foreign efforts", "stamps of 1970 and 2038", "our names with wrong types",
        "transitions and parameters at once", "giant requests",
    ]  # fmt: skip
    rows = run_attacks(names, tmp_path, lambda _: None)
    assert [row.attack for row in rows] == names
    assert [row.violations for row in rows] == [()] * len(names)
    assert all(row.alive for row in rows)
    assert rows[0].worst_mode == "FAULT"
    assert rows[0].helped
    written = json.loads((tmp_path / "attacks.json").read_text())
    assert [row["kept"] for row in written] == [True] * len(names)


def test_a_stricter_promise_than_the_limiter_keeps_and_a_dead_node_are_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def kill(stage: attack_suite.AttackStage) -> str:
        stage.nodes.send("bridge", 9)
        stage.go_on(0.5)
        return ""

    monkeypatch.setitem(ATTACKS, "kill", kill)
    with campaign_of(attack_suite.AttackStage, tmp_path, 0.5) as stage:
        row = stage.attack("kill")
    assert not row.alive
    assert not row.kept
    assert any("effort steps" in text for text in row.violations)
    assert any("bridge ended" in text for text in row.violations)
