"""Contents that swing in the object push it to and fro, and the controller knows nothing of them."""

from __future__ import annotations

from test.support.every import every
from test.support.loose_contents import with_loose_contents


@every(("drive", "scenario"), (("motor_current", "glass_transport"), ("ideal", "paper_planar")))
def test_a_governed_arm_keeps_the_object_where_classical_control_slips_far(drive: str, scenario: str) -> None:
    governed, classical = (
        with_loose_contents(0.2, 3.0, scenario, drive, law, 2500) for law in ("governed", "classical")
    )
    assert governed.slip < 1e-3
    assert classical.slip > 10e-3
