"""Bad configuration: one clear line each."""

from __future__ import annotations

import re
from typing import Any

import pytest

from slip_core.errors import InputError
from slip_core.params import build, parameter_infos
from slip_vic.scenarios.scenario import NODES
from slip_vic_controller.params.controller_params import ControllerParams
from test.support.one_arm import one_arm
from test.support.small_arm import small_arm_urdf

BAD: list[tuple[dict[str, Any], list[str]]] = [
    ({"gains.stiffness": (5.0, 5.0, 0.0, 1.0, 1.0, 1.0)}, ["stiffness", "positive"]),
    ({"gains.damping": (5.0, 5.0, -1.0, 1.0, 1.0, 1.0)}, ["damping", "positive"]),
    ({"gains.inertia": (1.0,) * 5}, ["inertia"]),
    ({"gains.inertia": (1.0,) * 7}, ["inertia"]),
    ({"gains.stiffness": (5.0, 5.0, float("nan"), 1.0, 1.0, 1.0)}, ["stiffness", "finite"]),
    ({"gains.k_s": 0.0}, ["gains.k_s", "greater than"]),
    ({"gains.alpha": -1.0}, ["gains.alpha"]),
    ({"gains.gamma_kp": -1.0}, ["gains.gamma_kp"]),
    ({"gains.ks": 1.0}, ["gains.ks", "did you mean", "gains.k_s"]),
    ({"controler": "vic"}, ["controler", "did you mean controller"]),
    ({"controller": "adaptive"}, ["controller", "vic", "classical"]),
    ({"attitude": "euler"}, ["attitude", "log", "rpy"]),
    ({"contacts.position": (0.0, 0.0)}, ["contacts", "3 n, 4 n, 6 n"]),
    ({"contacts.position": (0.0,) * 6}, ["contacts", "6, 4, 6"]),
    ({"contacts.position": (20.0, 0.0, 0.0)}, ["contacts", "1 m from the centre of mass"]),
    ({"gains.stiffness": (1e7,) * 6}, ["stiffness", "100000"]),
    ({"contacts.slip_axes": (True,) * 5}, ["contacts"]),
    ({"contacts.orientation_xyzw": (0.0,) * 4}, ["contacts", "orientation_xyzw", "norm"]),
    ({"contacts.orientation_xyzw": (0.0, 0.6007, 0.0, 0.8009)}, ["contacts", "orientation_xyzw", "norm"]),
    ({"object.mass": 0.0}, ["object.mass"]),
    ({"object.mass": 600.0}, ["object.mass", "100"]),
    ({"slip_sensor.noise_linear": 0.5}, ["slip_sensor.noise_linear", "0.1"]),
    ({"object.inertia": (1.0, 1.0, 3.0, 0.0, 0.0, 0.0)}, ["object.inertia", "principal moments"]),
    ({"object.inertia": (1.0, 1.0, 1.0)}, ["object.inertia"]),
    ({"object.inertia": (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}, ["object", "1 kg m2 of 0.5 kg", "radius of 1 m"]),
    ({"safety.limits.effort_rate": 1.0}, ["safety.limits.effort_rate", "1 N m/s", "at least"]),
    ({"trajectory.kind": "spiral"}, ["trajectory.kind"]),
    ({"trajectory.kind": "waypoints"}, ["trajectory", "waypoints"]),
    ({"trajectory.kind": "waypoints", "trajectory.waypoints": (0.0,) * 7}, ["waypoints has 7 values"]),
    ({"trajectory.kind": "circle", "trajectory.duration_s": 1.0}, ["trajectory", "ramp_s"]),
    ({"trajectory.kind": "quintic", "trajectory.rotation": (0.0, 0.0, 4.0)}, ["rotation", "at most pi"]),
    ({"trajectory.duration_s": 0.0}, ["trajectory.duration_s"]),
    ({"joint_names": ("arm_joint1",)}, ["joint_names", "move ee"]),
    ({"ee_frame": "tool"}, ["ee_frame", "tool"]),
    ({"gravity": (0.0, 0.0)}, ["gravity"]),
    ({"safety.resume_after_s": 1e300}, ["safety.resume_after_s", "less than or equal to"]),
    ({"control_period_s": 1e-9}, ["control_period_s", "greater than or equal to 0.00001"]),
]


@pytest.mark.parametrize(("values", "words"), BAD)
def test_bad_parameters_give_one_clear_line(values: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        one_arm(build(ControllerParams, values, "test.yaml"), small_arm_urdf(), lockstep=True)
    line = str(caught.value)
    assert "\n" not in line
    for word in words:
        assert word in line, line


def test_defaults_are_the_papers_gains() -> None:
    gains = ControllerParams().gains
    assert gains.stiffness == (5.0, 5.0, 5.0, 4.5, 4.5, 4.5)
    assert gains.damping == (2.5, 2.5, 2.5, 2.2, 2.2, 2.2)
    assert gains.inertia == (0.4, 0.4, 0.4, 0.3, 0.3, 0.3)
    assert {gains.gamma_kp, gains.alpha} == {100.0}
    assert gains.k_s == 1000.0


def test_every_description_stands_alone() -> None:
    """No description refers to the line above it."""
    leaning = re.compile(r"^(and|the same|share of that|that|it|or) ", re.IGNORECASE)
    for _, model in NODES.values():
        assert not [info.name for info in parameter_infos(model) if leaning.match(info.description)]
        assert not [info.name for info in parameter_infos(model) if len(info.description.split()) < 2]
