"""What drivers give in other forms is the same to the controller: wrench, gravity, joints, slip."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from slip_core.errors import InputError
from slip_core.records import new, place
from slip_core.types import DisplacementSample, JointCommand, WrenchSample
from slip_sim_bridge.sensors.slip import pose_of
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Scenario, load
from slip_vic_controller.interfaces import SlipFromDisplacement
from slip_vic_controller.law.arm import ARM as ARM_LAYOUT
from slip_vic_controller.state import INPUTS
from test.support.one_arm import one_arm

TICKS = 40
ROUNDING = 1e-9
"""Efforts of some 10 N m, one more rotation of the wrench on their way [N m]."""
ARM, _ROTATION = new(INPUTS)[place(INPUTS, "arm")], place(ARM_LAYOUT, "rotation")
PLACE, RPY = (0.01, -0.02, 0.05), (0.3, -0.2, 0.5)
TOOL, COM = 0.12, (0.0, 0.01, 0.04)


def scenario(*assignments: str, ticks: int = TICKS, name: str = "vertical_plane") -> Scenario:
    return load(name, law="vic", set=(f"bridge.duration_s={ticks / 1000}", *assignments))


def efforts(loaded: Scenario, wrench=lambda sample, R: sample, command=lambda loop, result: result.command):
    """Run a scenario; `wrench` stands for another sensor, `command` for other drives."""
    loop, found = ClosedLoop(loaded), []
    while not loop.bridge.finished:
        outputs = loop.bridge.observe()
        loop.session.arms[0].controller.robot.terms(outputs.arms[0].joint.position, outputs.arms[0].joint.velocity, ARM)
        R = ARM[_ROTATION].reshape(3, 3)
        wrenches = tuple(wrench(sample, R) for sample in outputs.arms[0].wrenches)
        result = loop.answer(outputs._replace(arms=(outputs.arms[0]._replace(wrenches=wrenches),)))[0]
        answer = command(loop, result)
        found.append(np.array(answer.numbers))
        loop.bridge.advance([answer])
    return np.array(found)


def test_another_wrench_sensor_gives_the_same_efforts() -> None:
    R_s = Rotation.from_euler("xyz", RPY).as_matrix()

    def elsewhere(sample: WrenchSample, R_ee: np.ndarray) -> WrenchSample:
        """What such a sensor measures: contact and tool, at its own origin, on its own axes, in g and kg cm."""
        force, torque = sample.wrench[:3], sample.wrench[3:]
        weight = TOOL * (R_ee.T @ [0.0, 0.0, -9.81])
        force, torque = force + weight, torque + np.cross(COM, weight)
        torque = torque - np.cross(PLACE, force)
        six = np.concatenate((R_s.T @ force / 9.80665e-3, R_s.T @ torque / 9.80665e-2))
        return WrenchSample(sample.stamp_ns, -six)

    there = scenario(
        f"controller.wrench.position={list(PLACE)}", f"controller.wrench.rpy={list(RPY)}", "controller.wrench.sign=-1",
        "controller.wrench.force_scale=9.80665e-3", "controller.wrench.torque_scale=9.80665e-2",
        f"controller.wrench.tool_mass={TOOL}", f"controller.wrench.tool_com={list(COM)}",
    )  # fmt: skip
    assert np.abs(efforts(there, elsewhere) - efforts(scenario())).max() < ROUNDING


def test_a_urdf_link_places_the_wrench_sensor() -> None:
    urdf = scenario().urdf.replace(
        "</robot>",
        '<link name="netft_link"/><joint name="netft_mount" type="fixed"><parent link="ee"/><child link="netft_link"/>'
        '<origin xyz="0.01 -0.02 0.05" rpy="0.3 -0.2 0.5"/></joint></robot>',
    )
    by_link = scenario("controller.wrench.frame=netft_link").controller
    by_numbers = scenario(f"controller.wrench.position={list(PLACE)}", f"controller.wrench.rpy={list(RPY)}").controller
    of_link, of_numbers = (one_arm(p, urdf, lockstep=True).config for p in (by_link, by_numbers))
    assert np.abs(of_link - of_numbers)[np.isfinite(of_link)].max() < 1e-12
    twice = scenario("controller.wrench.frame=netft_link", f"controller.wrench.position={list(PLACE)}").controller
    with pytest.raises(InputError, match="netft_link is a link of the URDF"):
        one_arm(twice, urdf, lockstep=True)
    with pytest.raises(InputError, match="a link that is fixed to ee"):
        one_arm(scenario("controller.wrench.frame=arm_link3").controller, urdf, lockstep=True)
    with pytest.raises(InputError, match=r"got sensor_frame, expected a link .* wrench\.position and"):
        one_arm(scenario("controller.wrench.frame=sensor_frame").controller, urdf, lockstep=True)


def test_an_arm_that_compensates_gravity() -> None:
    def with_gravity(loop: ClosedLoop, result) -> JointCommand:
        g = loop.session.arms[0].controller.robot.gravity(result.joint.position)
        return JointCommand(result.command.stamp_ns, result.command.numbers + g)

    own = scenario("controller.effort.gravity=robot_compensates")
    assert np.abs(efforts(own, command=with_gravity) - efforts(scenario())).max() < ROUNDING


def test_a_flag_and_an_observer_do_not_go_together() -> None:
    with pytest.raises(InputError, match="slip_estimator observer needs slip velocities"):
        scenario("slip_input=flag", "controller.slip_estimator=observer")


def test_displacements_give_their_slip_velocity() -> None:
    """A screw motion of the pad on the object: constant slip velocity on pad axes."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        v, w, dt = rng.normal(size=3), rng.normal(size=3), 1e-3
        made, screw = SlipFromDisplacement(), np.zeros((4, 4))
        screw[:3, :3], screw[:3, 3] = np.cross(np.eye(3), w), v
        for tick in range(4):
            moved = expm(screw * dt * tick)
            turned = Rotation.from_matrix(moved[:3, :3]).as_rotvec()
            slip = made(DisplacementSample(round(1e9 * dt * tick), pose_of(np.concatenate((moved[:3, 3], turned)))))
            if tick == 0:
                assert slip is None
            else:
                assert slip.stamp_ns == round(1e9 * dt * (tick - 0.5))
                assert np.abs(slip.twist - [*v, *w]).max() < 1e-6  # of second order in dt
    invalid = made(DisplacementSample(10, np.full(7, np.nan), valid=False))
    assert not invalid.valid
    assert made(DisplacementSample(20, pose_of(np.zeros(6)))) is None, "no velocity over a gap"
