"""Friction, offset, noise and quantum of a simulated arm, found again in its slow motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from slip_bags.reader import Bag
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_description import urdf_text
from slip_vic.cli import cli
from slip_vic.presets.models import DrivePreset, load_preset
from slip_vic.run.data import ArmData, Channel, urdf_of
from slip_vic.scenarios.scenario import load
from slip_vic.setup.identify import identify, read_motion, slip_mistake, velocity_of
from test.support.bag_maker import make_bag
from test.support.run_maker import record_run
from test.unit.bridge.scenes import scene

COULOMB = (0.8, 0.6, 0.5, 0.5, 0.3, 0.3, 0.2)
VISCOUS, OFFSET = 0.4, (0.1, -0.1, 0.05, 0.0, 0.05, -0.05, 0.02)
BAG = Path(__file__).parents[3] / "bags" / "paper_planar_classical"


def motion(times: Array, q: Array, v: Array, effort: Array) -> ArmData:
    rows = {"joints": q, "joint_velocity": v, "joint_effort": effort}
    channels = {name: Channel(times, own) for name, own in rows.items()}
    return ArmData("", urdf_text(), tuple(scene().params.joint_names), {}, channels)


def with_slip(twists: Callable[[Channel], Array]) -> ArmData:
    arm = read_motion(BAG)
    slip = arm.channel("slip_measured")
    return replace(arm, channels={**arm.channels, "slip_measured": Channel(slip.times, twists(slip))})


def slow_motion(seconds: float = 8.0) -> ArmData:
    """Let all joints go to and fro at up to 0.08 rad/s, with an empty hand, and record without noise."""
    simulation = scene(drive__coulomb=COULOMB, drive__viscous=(VISCOUS,), drive__offset=OFFSET)
    simulation.set_grip_force(0.0)
    simulation.step(None)
    start, wave = (
        simulation.observe().joint.position.copy(),
        2.0 * np.pi / np.array((3.0, 3.5, 4.0, 2.5, 3.2, 2.8, 3.7)),
    )
    rows: list[tuple[Array, Array, Array]] = []
    for k in range(round(1e3 * seconds)):
        t = 1e-3 * k
        target = start + 0.08 / wave * (1.0 - np.cos(wave * t))
        speed = 0.08 * np.sin(wave * t)
        state = simulation.observe().joint
        ahead = simulation.holding_effort(target, 900.0, 60.0) + 60.0 * speed * 0.2
        simulation.step(ahead + np.array(COULOMB) * np.tanh(speed / 0.01))
        rows.append((state.position, state.velocity, simulation.observe().joint.effort))
    q, v, effort = (np.array(column) for column in zip(*rows, strict=True))
    return motion(1e-3 * np.arange(len(q)), q, v, effort)


def test_friction_and_offset_are_found_again() -> None:
    found = identify(slow_motion(), "ee")
    for one, coulomb, offset in zip(found.itertuples(), COULOMB, OFFSET, strict=True):
        assert one.coulomb == pytest.approx(coulomb, abs=0.01), one
        assert one.viscous == pytest.approx(VISCOUS, abs=0.08), one
        assert one.offset == pytest.approx(offset, abs=0.005), one


def test_noise_and_quantum_are_found_again_and_a_joint_at_rest_has_no_friction_to_be_seen() -> None:
    rng, time = np.random.default_rng(1), 1e-3 * np.arange(4000)
    q = np.zeros((4000, 7))
    q[:, 0] = 0.05 * np.sin(time)
    v = 0.05 * np.cos(time)[:, None] * np.eye(7)[0] + 0.003 * rng.standard_normal((4000, 7))
    step = 2e-5
    found = identify(motion(time, step * np.round(q / step), v, np.zeros_like(q)), "ee")
    assert found["quantum"].iloc[0] == pytest.approx(step, rel=1e-6)
    assert (found["noise_position"] < step).all()
    np.testing.assert_allclose(found["noise_velocity"], 0.003, rtol=0.05)
    assert np.isnan(found["coulomb"].iloc[3])


def test_the_command_reads_a_bag_and_writes_a_drive_file(tmp_path: Path) -> None:
    file = tmp_path / "my_arm.yaml"
    result = CliRunner().invoke(cli, ["identify", str(BAG), "--out", str(file)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert "arm_joint7" in result.output
    assert load_preset(DrivePreset, str(file)).drive.interface == "effort"


def test_a_bag_without_velocities_shows_friction_too(tmp_path: Path) -> None:
    words = ("bridge.sensors.joint.velocity=false", "bridge.duration_s=3.0")
    record_run(tmp_path / "bag", load("glass_transport", law="classical", drive="torque_joint", set=words))
    recorded = read_motion(tmp_path / "bag")
    assert np.isfinite(velocity_of(recorded)).all()
    found = identify(recorded, "ee")
    assert found["coulomb"].iloc[1] == pytest.approx(0.3, abs=0.15)  # of the preset


@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ((1.0, 1.0, 1.0), ""), ((-1.0, -1.0, -1.0), "all axes are inverted"), ((1.0, 1.0, -1.0), "turning is inverted"),
    ],
)  # fmt: skip
def test_slip_of_a_bag_against_its_wrench(signs: tuple[float, float, float], words: str) -> None:
    said = slip_mistake(with_slip(lambda slip: slip.rows * (signs[0], signs[1], 1.0, 1.0, 1.0, signs[2])))
    assert bool(said) == bool(words)
    assert words in said


def test_held_values_of_a_bag() -> None:
    def held(slip: Channel) -> Array:
        since = slip.times - slip.times[0]
        return slip.rows[np.searchsorted(since, np.floor(since * 30.0) / 30.0)]

    assert "values change at 30 Hz" in slip_mistake(with_slip(held))


def test_joint_states_of_varying_length_and_a_description_at_the_root(tmp_path: Path) -> None:
    topics = {"/robot/joint_states": "sensor_msgs/msg/JointState", "/robot_description": "std_msgs/msg/String"}
    made = make_bag(tmp_path / "bag", topics=topics)
    assert urdf_of(Bag(tmp_path / "bag"), "robot") == made["/robot_description"][0][-1].data
    with pytest.raises(InputError, match="topic /robot/joint_states: got position of varying length"):
        read_motion(tmp_path / "bag")
