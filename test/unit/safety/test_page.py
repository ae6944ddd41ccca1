"""The safety page says what the code does."""

from __future__ import annotations

from pathlib import Path

from slip_vic_controller.params.safety_params import SafetyParams
from slip_vic_controller.safety.faults import reaction_table
from slip_vic_controller.safety.modes import Mode
from test.campaigns.faults.plan import ON_NODES, ON_TOPICS

PAGE = (Path(__file__).parents[3] / "docs" / "safety.md").read_text(encoding="utf-8")


def test_reaction_table_is_the_code_s() -> None:
    assert len(reaction_table().splitlines()) > 20
    assert reaction_table() in PAGE


def test_every_mode_has_its_row() -> None:
    for mode in Mode:
        assert f"| {mode.name} |" in PAGE


def test_limits_are_the_defaults() -> None:
    safety = SafetyParams()
    for text in (
        f"{safety.limits.effort_rate:g} N m/s; a pause counts {1e3 * safety.limits.longest_step_s:g} ms",
        f"the first after {1e3 * safety.limits.restart_after_s:g} ms without one",
        f"from {safety.limits.position_margin:g} rad before a stop",
        f"braked from {100 * safety.limits.velocity_brake:g} % of the URDF's velocity; "
        f"FAULT at {100 * safety.limits.velocity_trip:g} %",
        f"braked at {safety.limits.speed_linear:g} m/s, {safety.limits.speed_angular:g} rad/s",
        f"half of {safety.limits.error_linear:g} m, {safety.limits.error_angular:g} rad",
        f"HOLD after {1e3 * safety.inputs.joint.age_s:g} ms",
        f"goes on for {1e3 * safety.inputs.bridge_s:g} ms by the model",
        f"after {1e3 * safety.inputs.slip.age_s:g} ms {safety.fallback.observer_s:g} s on the observer, "
        f"{2 * safety.fallback.slow_down_s:g} s to come to rest",
        f"stiffness {safety.hold_stiffness:g} 1/s^2 and damping {safety.hold_damping:g} 1/s over the inertia",
    ):
        assert text in PAGE, text
    assert safety.inputs.wrench.age_s == safety.inputs.joint.age_s


def test_every_kind_of_fault_is_named() -> None:
    for kind in (*ON_TOPICS, *ON_NODES):
        word = kind.split("_")[0]
        assert word in PAGE or {"stop": "SIGSTOP"}.get(word, "?") in PAGE, kind
