"""Soft pads give way before they slip, and a slip sensor that looks at the object reports that as slip."""

from __future__ import annotations

from test.support.every import every
from test.support.soft_pads import on_soft_pads

STIFFNESS = 3e3


@every(
    ("drive", "scenario", "sensor"),
    (
        ("velocity_500", "glass_transport", "event_1000"),
        ("ideal", "paper_planar", "event_1000"),
    ),
)
def test_a_governed_arm_that_is_not_told_keeps_the_object(drive: str, scenario: str, sensor: str) -> None:
    """It learnt a fifth of the friction there is from pads that gave way, overran its path and lost the object."""
    run = on_soft_pads(STIFFNESS, scenario, drive, "governed", 2500, sensor=sensor, told=False)
    assert run.slip < 1e-3
    assert not [said for said in run.said if said.startswith("FAULT")]


def test_one_that_is_told_does_not_slow_down_for_them() -> None:
    told, untold = (
        on_soft_pads(
            STIFFNESS, "vertical_plane", "torque_joint", "governed", 1500, sensor="optical_flow_120", told=told
        )
        for told in (True, False)
    )
    assert told.slip < 1e-3
    assert told.fastest > 2.0 * untold.fastest
