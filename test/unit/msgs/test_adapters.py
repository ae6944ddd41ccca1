"""Vendors' messages, made by hand: what they say comes out in the controller's units."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from examples.tactile_adapters.adapter import PAPILLARRAY, XELA, message_type
from examples.tactile_adapters.conversions import (
    papillarray_flags,
    papillarray_wrench,
    taxel_places,
    xela_forces,
    xela_wrench,
)
from examples.tactile_adapters.field_twist import planar_twist
from slip_core.errors import InputError


def papillarray(states, *, active: bool = True, loaded: bool = True, contact: bool = True) -> SimpleNamespace:
    pillars = [SimpleNamespace(id=i, slip_state=state, in_contact=contact) for i, state in enumerate(states)]
    forces = {"gfx": 0.1, "gfy": -0.2, "gfz": 1.5, "gtx": 3.0, "gty": 0.0, "gtz": -40.0}
    return SimpleNamespace(pillars=pillars, is_sd_active=active, is_ref_loaded=loaded, **forces)


def test_a_pillar_slips_holds_or_is_not_known() -> None:
    known = papillarray_flags(papillarray([1, 3, 0]))
    assert list(known) == ["pillar_0", "pillar_1", "pillar_2"]
    assert list(known.values())[:2] == [0.0, 1.0]
    assert math.isnan(known["pillar_2"])
    for off in ({"active": False}, {"loaded": False}, {"contact": False}):
        assert all(math.isnan(flag) for flag in papillarray_flags(papillarray([1, 3], **off)).values()), off


def test_torques_are_newton_metres() -> None:
    assert np.allclose(papillarray_wrench(papillarray([1])), [0.1, -0.2, 1.5, 3e-3, 0.0, -40e-3], rtol=1e-12)


def test_a_pressed_corner_of_a_taxel_grid_turns_it() -> None:
    places = taxel_places(4, 4, 5e-3)
    assert np.abs(places.mean(axis=0)).max() < 1e-15
    assert np.allclose(places[0], [-7.5e-3, -7.5e-3, 0.0])
    forces = [SimpleNamespace(x=0.0, y=0.0, z=0.0) for _ in range(16)]
    forces[0] = SimpleNamespace(x=0.0, y=0.0, z=-2.0)
    stream = SimpleNamespace(sensors=[SimpleNamespace(sensor_pos=1, forces=forces)])
    # r x f = (y f_z, -x f_z)
    assert np.allclose(xela_wrench(stream, 1, places), [0.0, 0.0, -2.0, 15e-3, -15e-3, 0.0], rtol=1e-12)
    for sensor, given, said in ((2, forces, "sensor"), (1, [], "calibrated"), (1, forces[:9], "9 forces")):
        bad = SimpleNamespace(sensors=[SimpleNamespace(sensor_pos=1, forces=given)])
        with pytest.raises(InputError, match=said):
            xela_wrench(bad, sensor, places)


def test_a_package_that_is_not_installed_is_said_in_one_line() -> None:
    for wanted in (PAPILLARRAY, XELA):
        with pytest.raises(InputError, match=f"{wanted[0]}/msg/{wanted[1]}.*source its setup file") as error:
            message_type(*wanted)
        assert "\n" not in str(error.value)


def test_shear_of_the_taxels_is_a_field_with_a_twist() -> None:
    """A force and a rotation of the field [N], [N/m], with one taxel that sticks."""
    places = taxel_places(4, 4, 4.7e-3)
    shear = np.array([0.2, -0.1]) + 30.0 * np.stack([-places[:, 1], places[:, 0]], axis=1)
    shear[5] = 9.0
    forces = [SimpleNamespace(x=x, y=y, z=-0.1) for x, y in shear.tolist()]
    stream = SimpleNamespace(sensors=[SimpleNamespace(sensor_pos=1, forces=forces)])
    twist = planar_twist(places[:, :2], xela_forces(stream, 1, places)[:, :2])
    assert twist.angular == pytest.approx(30.0, rel=1e-6)
    assert twist.weights[5] == pytest.approx(0.0, abs=1e-6)
