"""The bench measures the whole control cycle, and the same one again; what it costs is no test's business."""

from __future__ import annotations

from slip_vic.scenarios.scenario import load
from test.campaigns.bench import cost


def test_measured_step_is_the_whole_cycle() -> None:
    now, rounds = cost.stretch(load(cost.SCENARIO, law="vic"), ticks=30), []
    for _ in range(2):
        now.restore()
        results = [now.step() for _ in now.inputs]
        assert all(result.record.ok for result in results)
        rounds.append([result.command.numbers.tobytes() for result in results])
    assert rounds[0] == rounds[1]
    assert len(set(rounds[0])) == cost.STRETCH
