"""What went wrong is said: FAULT, a lost object, a path that cannot be followed, saturation; in process."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from slip_core.types import Incident
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import Law, load
from slip_vic_controller.safety.conditions import Mode, Reason
from slip_vic_controller.session.cycle_result import UNREACHABLE_S, IncidentWatch


def told(name: str, *assignments: str, kind: Law = "classical") -> list[Incident]:
    scenario = load(name, law=kind, set=assignments)
    return [incident for tick in run_in_process(scenario) for incident in tick.incidents]


def test_a_run_that_goes_well_tells_nothing() -> None:
    assert told("paper_planar", "bridge.duration_s=1.2") == []


def test_a_lost_object_is_told_once() -> None:
    lost = told("vertical_plane", "bridge.grip.force=1.0", "bridge.duration_s=0.6")
    assert [incident.kind for incident in lost].count("lost") == 1
    (grip,) = (i for i in told("paper_planar", "bridge.grip.force=0.0", "bridge.duration_s=0.02") if i.kind == "lost")
    assert grip.text == "the object is lost: the grip is zero"


def test_a_fault_and_a_path_that_is_refused_are_told() -> None:
    fault = told("glass_transport", "controller.gains.spin=follow", "bridge.duration_s=0.3", kind="vic")[0]
    assert fault.kind == "fault"
    assert 0.1 < fault.time_s < 0.3
    (refused,) = told("vertical_plane", "controller.governor.margin=0.95", "bridge.duration_s=0.3", kind="governed")
    assert refused.kind == "unreachable"
    assert "at 800 ms of the path" in refused.text


def seen(*rows: tuple[float, Mode, int]) -> list[tuple[str, float]]:
    """Show a watch (time [s], mode, cause) and return kind and time of what it tells."""
    watch, found = IncidentWatch(), []
    for time_s, mode, cause in rows:
        result: Any = SimpleNamespace(
            mode=mode,
            reason_key=(int(cause), 0, 0, 0),
            reason="why",
            joint=SimpleNamespace(stamp_ns=round(1e9 * time_s)),
        )
        incident = watch.see(result)
        found += [] if incident is None else [(incident.kind, incident.time_s)]
    return found


def test_each_kind_is_told_once_and_in_the_time_of_the_run() -> None:
    active, careful = Mode.ACTIVE, Mode.DEGRADED
    assert seen((5.0, active, 0), (6.0, careful, Reason.SATURATED), (7.0, careful, Reason.SATURATED)) == [
        ("saturated", 1.0)
    ]
    assert seen((5.0, Mode.FAULT, Reason.ASKED), (6.0, active, 0), (7.0, Mode.FAULT, Reason.ASKED)) == [("fault", 0.0)]
    assert seen((0.0, Mode.HOLD, Reason.ASKED), (1.0, careful, Reason.SLIP_PREDICTED)) == []


def test_a_path_that_waits_for_the_arm_is_unreachable_only_when_it_waits_long() -> None:
    waits, late = (Mode.DEGRADED, Reason.PATH_WAITS), 1.01 * UNREACHABLE_S
    assert seen((0.0, *waits), (late, *waits)) == [("unreachable", pytest.approx(late))]
    assert seen((0.0, *waits), (1.0, Mode.ACTIVE, 0), (late, *waits), (1.9 * late, *waits)) == []
