"""A law of one's own: the suite's laws through the same door to the same bits, the limiter, what a law does wrong."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import slip_vic
from slip_core.errors import InputError
from slip_core.records import record
from slip_vic.experiments.driven import driven
from slip_vic.experiments.law import find_law
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.robot import Robot
from slip_vic_controller.state import CONFIG


def scenario(law: str = "vic", ticks: int = 60, **more: Any) -> Scenario:
    name = more.pop("name", "paper_planar")
    return slip_vic.load(name, law=law, set=[f"bridge.duration_s={1e-3 * ticks}", *more.pop("set", [])], **more)


def law_of(step: Callable[[Any], Any], **more: Any) -> Any:
    """Return a law that is one function."""
    body = {"needs": frozenset({"wrench"}), "reset": lambda self, setup: setattr(self, "setup", setup)} | more
    return type("Own", (), body | {"step": lambda self, seen: step(seen)})()


@pytest.mark.parametrize(
    ("law", "name"),
    [*((law, "paper_planar") for law in ("classical", "vic", "governed")), ("vic", "pane_two_arms_flat")],
)
def test_the_laws_of_the_suite_give_the_same_bits_through_the_door(law: str, name: str) -> None:
    loaded = scenario(law, 200, name=name, sensor="vision_60", drive="torque_joint", seed=3)
    direct = [np.array(tick.efforts).tobytes() for tick in loaded.ticks()]
    through = [np.array(tick.efforts).tobytes() for tick in driven(loaded, find_law(law).kind())]
    assert through == direct
    assert len(set(direct)) > 100


def test_a_law_sees_nothing_of_the_simulated_world() -> None:
    """The object is half as heavy in the world as configured, and friction is less: a law gets what is configured."""
    seen = []
    own = law_of(lambda one: seen.append(one), needs=frozenset())
    loaded = scenario(set=["bridge.object.mass=0.25", "bridge.friction.mu_s=0.3", "bridge.friction.mu_k=0.2"], ticks=5)
    assert len(list(driven(loaded, own))) == 5
    assert own.setup.mass == 0.5
    assert own.setup.friction_limit == 0.25
    assert not seen[-1].wrench.any()
    assert seen[-1].slips == seen[-1].wrenches == ()
    start, end = own.setup.reference(0.0), own.setup.reference(10.0)
    np.testing.assert_allclose(end.position - start.position, [0.4, 0.3, 0.0], atol=1e-12)
    assert own.setup.duration_s == 2.0


def test_an_acceleration_of_the_pad_becomes_an_effort_by_the_torque_law() -> None:
    """Eq. (21) in plain numpy, with the null space at the posture of the first tick."""
    a, seen = np.array([0.3, -0.2, 0.1, 0.5, 0.4, -0.6]), []
    loaded = scenario(ticks=10)
    efforts = [tick.effort for tick in driven(loaded, law_of(lambda one: seen.append(one) or slip_vic.Pad(a)))]
    one, before = seen[-1], seen[-2]
    params = loaded.controllers[""]
    robot = Robot(loaded.placed[""], params.ee_frame, params.joint_names, params.gravity)
    step = 1e-7
    ahead, behind = (robot.frame(one.q + sign * step * one.qd)[2] for sign in (1.0, -1.0))
    jdot_qd = (ahead - behind) @ one.qd / (2.0 * step)
    Minv = np.linalg.inv(one.M)
    Lambda = np.linalg.inv(one.J @ Minv @ one.J.T)
    null = params.nullspace
    tau_0 = null.stiffness * (seen[0].q - one.q) - null.damping * one.qd
    N = np.eye(7) - Minv @ one.J.T @ Lambda @ one.J
    h = np.kron(np.eye(2), one.rotation) @ one.wrench
    tau = one.J.T @ (Lambda @ (a - jdot_qd) - h) + one.bias + N.T @ tau_0
    np.testing.assert_allclose(efforts[-1], tau, atol=1e-6)
    assert one.time - before.time == pytest.approx(1e-3, rel=1e-9)


def test_the_limiter_is_the_last_whatever_a_law_wants() -> None:
    wild = iter(np.random.default_rng(5).choice([-1e9, 1e9], size=(200, 7)))
    loaded = scenario(ticks=100)
    efforts = np.array([tick.effort for tick in driven(loaded, law_of(lambda _: slip_vic.Effort(next(wild))))])
    params = loaded.controllers[""]
    limit = Robot(loaded.placed[""], params.ee_frame, params.joint_names, params.gravity).effort_limit
    assert (np.abs(efforts) <= limit).all()
    assert np.abs(np.diff(efforts, axis=0)).max() <= params.safety.limits.effort_rate * 1e-3 * (1.0 + 1e-12)


@pytest.mark.parametrize("drive", ["velocity_500", "position_250"])
def test_a_law_of_accelerations_follows_its_path_on_drives_with_loops_of_their_own(drive: str) -> None:
    errors: list[Any] = []

    def step(seen: Any) -> Any:
        wanted = own.setup.reference(seen.time)
        error = seen.way_to(wanted)
        errors.append((np.linalg.norm(error), np.linalg.norm(wanted.twist[:3])))
        return slip_vic.Pad(wanted.acceleration + 100.0 * error + 20.0 * (wanted.twist - seen.twist))

    own = law_of(step)
    loaded = scenario("classical", 600, drive=drive, set=["controller.trajectory.duration_s=4.0"])
    assert len(list(driven(loaded, own))) == 600
    off, speed = np.max(errors, axis=0)
    assert off < 1e-3  # m, rad
    assert speed > 0.05


@pytest.mark.parametrize("drive", ["velocity_500", "position_250"])
def test_wild_efforts_stay_inside_the_limits_of_the_motion(drive: str) -> None:
    wild = iter(np.random.default_rng(6).choice([-1e6, 1e6, 0.3], size=(300, 7)))
    loaded = scenario("classical", 200, drive=drive)
    ticks = driven(loaded, law_of(lambda _: slip_vic.Effort(next(wild))))
    commands = np.array([tick.commands[0].numbers for tick in ticks])
    velocity = commands if drive == "velocity_500" else np.diff(commands, axis=0) / 1e-3
    config = record(ArmController(loaded.controller, loaded.urdf, lockstep=True).config, CONFIG).command
    assert (np.abs(velocity) <= config.velocity[:7] * (1.0 + 1e-9)).all()
    assert (np.abs(np.diff(velocity, axis=0)) <= config.acceleration[:7] * 1.01e-3 + 1e-9).all()


def test_an_effort_moves_drives_of_their_own_as_the_acceleration_it_stands_for() -> None:
    """The effort of Eq. (1) for joint accelerations of zero: its velocity stays, in spite of its weight."""

    def step(seen: Any) -> Any:
        h = np.concatenate((seen.rotation @ seen.wrench[:3], seen.rotation @ seen.wrench[3:]))
        return slip_vic.Effort(seen.bias - seen.J.T @ h)

    ticks = driven(scenario("classical", 200, drive="velocity_500"), law_of(step))
    commands = np.array([tick.commands[0].numbers for tick in ticks])
    assert len(commands) == 200
    assert np.ptp(commands, axis=0).max() < 1e-9, "the velocity it started with"


def test_a_grip_is_limited_by_the_track_and_by_the_gripper() -> None:
    def squeezed(most: float | None) -> list[float | None]:
        ticks = driven(scenario(ticks=3), law_of(lambda one: slip_vic.Effort(one.bias, grip=1e3)), most)
        return [tick.grips[0] for tick in ticks]

    assert (squeezed(0.5), squeezed(None)) == ([0.5] * 3, [10.0] * 3)


def raises(_: Any) -> None:
    raise BaseException("no\nidea")


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (raises, "step raises BaseException: no idea"),
        (lambda _: slip_vic.Pad(np.full(6, np.nan)), "Pad.acceleration is not finite"),
        (lambda _: slip_vic.Pad(np.zeros(3)), r"Pad.acceleration has the shape \(3,\); expected \(6,\)"),
        (lambda _: slip_vic.Effort(np.zeros(6)), r"Effort.effort has the shape \(6,\); expected \(7,\)"),
        (lambda _: slip_vic.Effort("much"), "Effort.effort is 'much'; expected 7 numbers"),
        (lambda _: slip_vic.Effort(np.zeros(7), grip=-1.0), "grip is -1 N; expected 0 or more"),
        (lambda _: np.zeros(7), "step returns ndarray; expected Pad, Effort or None"),
    ],
)
def test_what_a_law_does_wrong_ends_its_run_with_one_line(step: Any, message: str) -> None:
    with pytest.raises(InputError, match=rf"law Own: got 0\.000 s: {message}") as error:
        scenario(ticks=5).run(law=law_of(step))
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match=r"a slip_vic\.Law"):
        scenario(ticks=5).run(law=step)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("governd", "", "did you mean governed"),
        ("no_such_module:Law", "", "No module named 'no_such_module'"),
        ("FILE:Mine", "1/0", "ZeroDivisionError"),
        ("FILE:Mine", "import os; os._exit(0)", "SystemExit: 0"),
        ("FILE:Mine", "raise BaseException('\x1b')", r"BaseException: \\x1b"),
        ("FILE:Mine", "class Mine: __module__ = 5", "built-in class"),
        ("FILE:Mine", "class Min:\n    def step(self, s): ...", "did you mean Min"),
        ("FILE:Mine", "class Mine:\n    def step(self, s): ...", r"expected reset\(setup\)"),
        ("FILE:Mine", "class Mine:\n    def reset(self, s): ...\n    step = reset", "needs as a frozenset"),
        ("missing.py:Mine", "", "no file missing.py"),
    ],
)
def test_what_is_no_law_is_refused_with_one_line(tmp_path_factory: Any, name: str, text: str, message: str) -> None:
    file = tmp_path_factory.mktemp("law") / "mine.py"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        find_law(name.replace("FILE", str(file)))
