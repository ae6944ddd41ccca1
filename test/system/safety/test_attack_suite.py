"""The attack suite on real nodes: some of its attacks, and a monitor that can fail."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from test.campaigns.attacks import suite
from test.campaigns.attacks.attacks import ATTACKS

pytestmark = pytest.mark.long


@pytest.fixture(autouse=True)
def _own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


def test_promise_is_kept_under_attack(tmp_path: Path) -> None:
    names = ["foreign efforts", "stamps of 1970 and 2038", "transitions and parameters at once"]
    rows = suite.run_attacks(names, tmp_path, lambda _: None)
    assert [row.attack for row in rows] == names
    assert [row.violations for row in rows] == [()] * len(names)
    assert all(row.alive for row in rows)
    assert rows[0].worst_mode == "FAULT"
    assert rows[0].helped
    written = json.loads((tmp_path / "attacks.json").read_text())
    assert [row["kept"] for row in written] == [True] * len(names)


def test_monitor_sees_violations(monkeypatch: pytest.MonkeyPatch) -> None:
    def kill(stage: suite.Stage) -> str:
        stage.wait(3.0)
        stage._nodes["bridge"].kill()
        stage.wait(0.5)
        return ""

    monkeypatch.setitem(ATTACKS, "kill", kill)
    with suite.stage(effort_rate=0.5) as stage:
        row = stage.attack("kill")
    assert not row.alive
    assert not row.kept
    assert any("command steps" in text for text in row.violations)
    assert any("bridge ended" in text for text in row.violations)
