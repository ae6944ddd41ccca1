"""How far the ellipsoid of our limit surface is from a disc under uniform pressure, the simplest pad there is."""

import pytest

from test.referees.disc_limit import disc_limit

ENDS = 1e-3  # of 1: the points of the sum
INSIDE = {15: 0.9775, 30: 0.943, 45: 0.936, 60: 0.954, 75: 0.985}
"""Share of the ellipsoid that the disc carries; docs/fidelity.md has these numbers."""


def test_pure_force_and_pure_torque_are_those_of_the_disc() -> None:
    assert disc_limit(0.0) == pytest.approx(1.0, abs=ENDS)
    assert disc_limit(90.0) == pytest.approx(1.0, abs=ENDS)


def test_force_with_torque_is_up_to_6_percent_less() -> None:
    for degrees, share in INSIDE.items():
        assert disc_limit(degrees) == pytest.approx(share, abs=ENDS), degrees
    assert min(INSIDE.values()) == INSIDE[45]
