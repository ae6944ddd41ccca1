"""HOLD: its effort, its load, and the delay that it bears: in closed form and in simulated loops."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slip_core.records import new, record
from slip_core.vectors import Vec
from slip_sim_bridge.session import TickOutputs
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.params.safety_params import SafetyParams
from slip_vic_controller.safety.hold import (
    EXCESS,
    HOLD,
    HOLD_CONFIG,
    LEAST_LOAD,
    LOAD_LEVER,
    SLOWEST,
    carry_load,
    delay_margin,
    gains_for_delay,
    hold_effort,
    keep_posture,
    load_error,
    plausible_arm,
)
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.safety.validation import JOINT_SAMPLE
from slip_vic_controller.state import CONFIG
from test.campaigns.faults.trial import STEADY_NS
from test.referees.law_referee import S, exponential, two
from test.support.call import call, flat
from test.support.delivery import answered_outputs, begun_bridge, realtime
from test.support.made_up import LOAD, POSITION, MadeUp, N, law_at_work
from test.support.one_arm import one_arm

SAFETY = SafetyParams()
DAMPING = 2.0 * math.sqrt(SAFETY.hold_stiffness)  # critical
BORNE_S = 0.020  # docs/safety.md
REST_RAD_S = 0.1  # what the campaign calls rest, a second after the law
MS = 1_000_000
CLOSE = 1e-9  # relative to the largest: products of matrices of size 1 to 100
SCENARIOS = ("paper_planar", "vertical_plane", "glass_transport")


def held_inertia(M: np.ndarray, J: np.ndarray, r: np.ndarray, mass: float, inertia: np.ndarray) -> np.ndarray:
    """Return M + J_o^T B_o J_o / 2; r = x_c - x_o {w}, inertia {w}."""
    J_v = J[:3] + S(r) @ J[3:]
    return M + 0.5 * (mass * J_v.T @ J_v + J[3:].T @ inertia @ J[3:])


def object_load(R: np.ndarray, r: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the wrench on the pad of a resting object {ee}."""
    return two(R.T) @ np.concatenate((weight, -np.cross(r, weight)))


def hold_torque(
    arm: Any, pad: np.ndarray, q: np.ndarray, qd: np.ndarray, posture: np.ndarray, r_pad: np.ndarray,
    gains: tuple[float, float], mass: float, inertia: np.ndarray, weight: np.ndarray, error: np.ndarray, *,
    carries: bool,
) -> np.ndarray:  # fmt: skip
    """Return g + (M + J_o^T B_o J_o / 2) (k (q_0 - q) - d qd) - J^T h."""
    R, (k, d) = arm.rotation, gains
    R_o, r = R @ pad.T, R @ r_pad
    H = held_inertia(arm.M, arm.J, r, mass, R_o @ inertia @ R_o.T)
    torque = arm.gravity + H @ (k * (posture - q) - d * qd)
    return torque - carries * (arm.J.T @ two(R) @ (object_load(R, r, weight) + error))


class Random:
    """A random arm in HOLD with a random object."""

    def __init__(self, seed: int, n: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        self.n, self.buffers = n, [new(layout) for layout in (HOLD_CONFIG, HOLD, ARM)]
        self.config, self.hold, self.arm = (
            record(buffer, layout) for buffer, layout in zip(self.buffers, (HOLD_CONFIG, HOLD, ARM), strict=True)
        )
        root, inertia_root = rng.standard_normal((n, n)), 0.3 * rng.standard_normal((3, 3))
        self.config.stiffness, self.config.damping, self.config.load_s = 225.0, 30.0, 0.05
        self.config.mass, self.config.inertia[:] = 0.7, inertia_root @ inertia_root.T
        self.config.weight[:] = self.config.mass * rng.standard_normal(3) * 9.81
        self.hold.posture[:n], self.hold.load_error[:] = rng.standard_normal(n), rng.standard_normal(6)
        self.arm.M[:n, :n], self.arm.J[:, :n] = root @ root.T, rng.standard_normal((6, n))
        self.arm.rotation[:], self.arm.gravity[:n] = exponential(rng.standard_normal(3)), rng.standard_normal(n)
        self.pad, self.r_pad = exponential(rng.standard_normal(3)), 0.3 * rng.standard_normal(3)
        self.sample_buffer = new(JOINT_SAMPLE)
        sample = record(self.sample_buffer, JOINT_SAMPLE)
        self.q, self.qd = sample.position[:n], sample.velocity[:n]
        self.q[:], self.qd[:] = rng.standard_normal((2, n))
        self.config.joints = n

    def torque(self, late_s: float, carries: bool) -> np.ndarray:
        out, (config, hold, arm) = np.empty(self.n), self.buffers
        call(hold_effort, config, hold, arm, self.sample_buffer, self.pad, self.r_pad, late_s, out)
        if carries:
            call(carry_load, config, hold, arm, self.r_pad, out)
        return out

    def referee(self, late_s: float, carries: bool) -> np.ndarray:
        n, a, c = self.n, self.arm, self.config
        arm = type("Arm", (), {"rotation": a.rotation, "gravity": a.gravity[:n], "J": a.J[:, :n], "M": a.M[:n, :n]})
        gains = call(gains_for_delay, c.stiffness, c.damping, late_s)
        return hold_torque(
            arm, self.pad, self.q, self.qd, self.hold.posture[:n], self.r_pad, gains, c.mass, c.inertia, c.weight,
            self.hold.load_error, carries=carries,
        )  # fmt: skip


def test_effort_of_hold() -> None:
    for seed in range(24):
        case = Random(seed, 3 + seed % 8)
        for late_s in (0.0, 0.01, 0.025, 0.05, 1.0):
            for carries in (True, False):
                expected = case.referee(late_s, carries)
                np.testing.assert_allclose(
                    case.torque(late_s, carries), expected, rtol=0.0, atol=CLOSE * np.abs(expected).max()
                )


def test_at_rest_in_its_posture_it_is_gravity_and_load() -> None:
    case = Random(0, 7)
    case.q[:], case.qd[:] = case.hold.posture[:7], 0.0
    np.testing.assert_array_equal(case.torque(0.0, False), case.arm.gravity[:7])
    R, r = case.arm.rotation, case.arm.rotation @ case.r_pad
    load = object_load(R, r, case.config.weight) + case.hold.load_error
    world = np.concatenate((R @ load[:3], R @ load[3:]))
    np.testing.assert_allclose(case.torque(0.0, True), case.arm.gravity[:7] - case.arm.J[:, :7].T @ world, atol=CLOSE)


def test_a_joint_that_was_thrown_rests_where_it_becomes_slow_again() -> None:
    """The others go back to the posture in which HOLD began."""
    made_up = law_at_work()
    assert made_up.past_validation(wrench=np.full(6, np.nan)).mode is Mode.HOLD
    before = np.array(made_up.state.hold.posture[:N])
    limit = record(made_up.controller.config, CONFIG).motion.velocity[:N]
    velocity = limit * np.array([1.01, -1.01, 0.99, -0.99, 0.0, 1.0, 1.4])
    away = made_up.joint(POSITION + np.linspace(0.1, 0.2, N), velocity)
    assert made_up.past_validation(away, passed_ns=0).mode is Mode.HOLD
    thrown, returns = np.abs(velocity) > limit, velocity < 0.0
    np.testing.assert_array_equal(made_up.state.hold.posture[:N], np.where(thrown | returns, away.position, before))
    assert (thrown | returns).tolist() == [True, True, False, True, False, False, True]


def test_a_joint_that_rests_elsewhere_stays_there_where_friction_can_hold_it() -> None:
    """Found by the campaign: compensation broke a wrist loose half a second later, and HOLD turned it back."""
    case = Random(0, N)
    hold, sample = case.hold, record(new(JOINT_SAMPLE), JOINT_SAMPLE)
    sample.position[:N] = [0.009, 0.011, -0.3, 0.3, 0.011, 0.0, -0.011]
    sample.velocity[:N] = [0.0, 0.0, -0.019, 0.021, 0.1, 0.0, 0.0]
    M = np.diag(np.linspace(0.1, 2.0, N))
    spring = 225.0 * np.abs(sample.position[:N]) * np.diag(M)
    for share, expected in ((0.99, np.zeros(N)), (1.01, [0.0, 0.011, -0.3, 0.0, 0.0, 0.0, -0.011])):
        hold.posture[:N] = 0.0
        call(keep_posture, case.buffers[0], hold, sample, np.full(N, 2.0), M, share * spring, 0.001)
        np.testing.assert_array_equal(hold.posture[:N], expected)


def test_two_joints_whose_pulls_cancel_stay_where_friction_can_hold_them() -> None:
    """Parallel axes: each alone would break loose, together they pull little; in step they pull more."""
    case = Random(0, N)
    hold, sample = case.hold, record(new(JOINT_SAMPLE), JOINT_SAMPLE)
    sample.position[:N] = [0.06, 0.0, -0.06, 0.0, 0.02, 0.02, 0.0]
    sample.velocity[:N] = 0.0
    M = np.eye(N)
    M[0, 2] = M[2, 0] = 0.9
    M[4, 5] = M[5, 4] = 0.8
    hold.posture[:N] = 0.0
    call(keep_posture, case.buffers[0], hold, sample, np.full(N, 2.0), M, np.full(N, 225.0 * 0.02 * 1.5), 0.001)
    np.testing.assert_array_equal(hold.posture[:N], [0.06, 0.0, -0.06, 0.0, 0.0, 0.0, 0.0])


def thrown_arm() -> Callable[[float, float, int], np.ndarray]:
    """Return what moves two joints, of which only the second can be thrown, and returns where HOLD keeps them."""
    case = Random(0, N)
    hold, sample = case.hold, record(new(JOINT_SAMPLE), JOINT_SAMPLE)
    hold.posture[:N], hold.thrown_s[:N] = 0.0, 0.0

    def pass_time(position: float, velocity: float, cycles: int) -> np.ndarray:
        sample.position[:2], sample.velocity[:2] = position, velocity
        limit = np.array([9.0, 2.0, *np.ones(N - 2)])
        for _ in range(cycles):
            call(keep_posture, case.buffers[0], hold, sample, limit, np.eye(N), np.zeros(N), 0.001)
        return np.array(hold.posture[:2])

    return pass_time


def test_a_joint_of_an_arm_that_was_thrown_stays_once_where_it_comes_to_rest() -> None:
    """What has thrown it passes; a load that the arm gives way to does not, and must not move it step by step.

    Found by the campaign: a wrist rested 0.17 rad away, and came back at 0.36 rad/s a second after.
    """
    pass_time = thrown_arm()
    np.testing.assert_array_equal(pass_time(0.1, 0.0, 1000), [0.0, 0.0])  # nothing has thrown it yet
    np.testing.assert_array_equal(pass_time(0.1, 3.0, 1), [0.0, 0.1])
    np.testing.assert_array_equal(pass_time(0.2, 0.5, 100), [0.0, 0.1])  # not yet at rest
    np.testing.assert_array_equal(pass_time(0.109, 0.0, 100), [0.109, 0.1])  # that is where HOLD wants the second one
    np.testing.assert_array_equal(pass_time(0.3, 0.01, 30), [0.109, 0.1])
    np.testing.assert_array_equal(pass_time(0.3, 0.5, 30), [0.109, 0.1])
    np.testing.assert_array_equal(pass_time(0.3, -0.01, 30), [0.109, 0.3])
    np.testing.assert_array_equal(pass_time(0.35, 0.0, 1000), [0.109, 0.3])  # a second time it goes back


def test_what_the_wrench_has_told_of_the_load_stays_over_a_silence_and_ends_with_the_law() -> None:
    """Without it an arm at rest sags when its controller has not run for a moment, though nothing else has changed."""
    made_up = law_at_work()
    assert made_up.past_validation(wrench=np.full(6, np.nan)).mode is Mode.HOLD
    heavier = LOAD + np.array([0.0, 0.0, -0.5, 0.0, 0.0, 0.0])
    assert made_up.run(80, wrench=heavier).mode is Mode.HOLD
    before = np.array(made_up.state.hold.load_error)
    assert np.linalg.norm(before) > 0.2
    made_up.pass_time(200 * MS)
    assert made_up.session.watchdog(made_up.now_ns).reason == "joint state is silent"
    assert made_up.run(1, wrench=heavier).mode is Mode.HOLD
    np.testing.assert_allclose(made_up.state.hold.load_error, before, atol=0.1 * np.linalg.norm(before))
    assert made_up.run(300).mode.follows
    np.testing.assert_array_equal(made_up.state.hold.load_error, 0.0)


def test_where_hold_has_not_run_for_long_the_arm_stays_where_something_else_has_put_it() -> None:
    """Up to the longest gap it goes back; after a longer pause that posture is no longer that of the arm."""
    for more_ns, stays in ((0, False), (1, True)):
        made_up = law_at_work()
        assert made_up.past_validation(wrench=np.full(6, np.nan)).mode is Mode.HOLD
        before = np.array(made_up.state.hold.posture[:N])
        gap_ns = int(record(made_up.controller.config, CONFIG).arbitration.gap_ns)
        away = made_up.joint(POSITION + 0.05, np.zeros(N))
        made_up.past_validation(away, passed_ns=gap_ns + more_ns)
        np.testing.assert_array_equal(made_up.state.hold.posture[:N], away.position if stays else before)


def test_the_law_goes_on_after_the_longest_gap_and_not_after_a_longer_one() -> None:
    for more_ns, mode in ((0, Mode.ACTIVE), (1, Mode.HOLD)):
        made_up = law_at_work()
        gap_ns = int(record(made_up.controller.config, CONFIG).arbitration.gap_ns)
        assert made_up.past_validation(passed_ns=gap_ns + more_ns).mode is mode


def test_a_controller_that_waits_for_inputs_knows_nothing_of_the_load() -> None:
    made_up = MadeUp()
    made_up.state.hold.load_error[:] = 3.0
    assert made_up.cycle(wrench=None, slip=None).mode == Mode.WAITING_INPUT
    assert not made_up.state.hold.load_error.any()


def test_held_inertia_by_kinetic_energy() -> None:
    """By the kinetic energy of both bodies."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        root, inertia_root = rng.standard_normal((7, 7)), 0.1 * rng.standard_normal((3, 3))
        M, J, r, qd = root @ root.T, rng.standard_normal((6, 7)), rng.standard_normal(3), rng.standard_normal(7)
        inertia, mass = inertia_root @ inertia_root.T, 0.7
        v, w = (J @ qd)[:3], (J @ qd)[3:]
        at_object = v - np.cross(w, r)
        energy = 0.5 * (mass * at_object @ at_object + w @ inertia @ w)
        found = 0.5 * qd @ held_inertia(M, J, r, mass, inertia) @ qd
        assert found == pytest.approx(0.5 * qd @ M @ qd + 0.5 * energy, rel=1e-12)


def test_a_real_grasp_is_within_the_assumed_excess() -> None:
    for name in SCENARIOS:
        scenario = load_scenario(name)
        controller = one_arm(scenario.controller, scenario.urdf, lockstep=False).first
        config, buffer = record(controller.config, CONFIG), new(ARM)
        n, contact, model = 7, config.law.contact[0], config.gains.object
        controller.robot.terms(np.array(scenario.bridge.initial_position), np.zeros(n), buffer)
        arm = record(buffer, ARM)
        R_o, M = arm.rotation @ contact.rotation.T, arm.M[:n, :n]
        inertia = R_o @ model.inertia @ R_o.T
        H = held_inertia(M, arm.J[:, :n], R_o @ config.gains.contact_position, model.mass, inertia)
        assert np.linalg.eigvals(np.linalg.solve(M, H)).real.max() < EXCESS
        share = len(scenario.controller.contacts.position) // 3
        assert config.hold.mass == pytest.approx(model.mass / share)
        np.testing.assert_allclose(config.hold.inertia, model.inertia / share)
        np.testing.assert_allclose(config.hold.weight, model.gravity * model.mass / share)


def test_the_wrench_corrects_the_load_slowly_and_by_no_more_than_the_weight() -> None:
    model, error = np.array([0.0, 0.0, -4.0, 0.1, 0.0, 0.0]), np.zeros(6)
    measured = model + np.array([0.5, 0.0, 0.3, 0.0, 0.05, 0.0])
    for _ in range(100):
        error = flat(call(load_error, error, model, measured, 0.004, 0.1, 0.0))
    np.testing.assert_allclose(error, (1.0 - math.exp(-4.0)) * (measured - model), atol=1e-12)
    for weight, most in ((12.0, 12.0), (0.6, LEAST_LOAD)):  # a mass told too small: the object is carried all the same
        model = np.array([0.0, 0.0, -weight, 0.1, 0.0, 0.0])
        for _ in range(1000):
            error = flat(call(load_error, error, model, 1e6 * np.ones(6), 0.004, 0.1, LEAST_LOAD))
        assert np.linalg.norm(error[:3]) == pytest.approx(most)
        assert np.linalg.norm(error[3:]) == pytest.approx(most * LOAD_LEVER)


# -- the delay that it bears --------------------------------------------------------------------------


def response(k: float, d: float, excess: float, delay_s: float) -> float:
    """Return how much a mass under k, d with a delay swings after 40 time constants, of 1 at the start."""
    dt, steps = 1e-4, round(40.0 / math.sqrt(excess * k) / 1e-4)
    x, v, late = 1.0, 0.0, deque([(1.0, 0.0)] * round(delay_s / dt))
    largest = 0.0
    for step in range(steps):
        late.append((x, v))
        x_old, v_old = late.popleft()
        v += dt * -excess * (k * x_old + d * v_old)
        x += dt * v
        if step > 0.9 * steps:
            largest = max(largest, abs(x))
    return largest


@pytest.mark.parametrize(("k", "d", "excess"), [(225.0, 30.0, 1.0), (225.0, 30.0, 1.5), (400.0, 40.0, 2.0)])
def test_delay_margin_is_where_a_simulated_joint_begins_to_swing(k: float, d: float, excess: float) -> None:
    margin = call(delay_margin, k, d, excess)
    assert response(k, d, excess, 0.93 * margin) < 0.2
    assert response(k, d, excess, 1.07 * margin) > 5.0


def test_without_gains_nothing_swings() -> None:
    assert call(delay_margin, 0.0, 0.0, EXCESS) == math.inf


def test_the_page_promises_what_the_gains_bear() -> None:
    at_100_hz = BORNE_S + 0.005  # half a period more: a command is held for one
    assert call(delay_margin, SAFETY.hold_stiffness, DAMPING, EXCESS) > at_100_hz


@pytest.mark.parametrize("period_s", [0.001, 0.01, 0.02, 0.1])
def test_a_slow_clock_takes_from_hold_no_more_of_its_margin_than_100_hz(period_s: float) -> None:
    scenario = load_scenario("paper_planar", assignments=(f"controller.control_period_s={period_s}",))
    hold = record(one_arm(scenario.controller, scenario.urdf, lockstep=True).first.config, CONFIG).hold
    slower = max(1.0, period_s / 0.01)
    margin = call(delay_margin, SAFETY.hold_stiffness, DAMPING, EXCESS)
    assert call(delay_margin, hold.stiffness, hold.damping, EXCESS) == pytest.approx(slower * margin)
    assert hold.stiffness * DAMPING**2 == pytest.approx(hold.damping**2 * SAFETY.hold_stiffness)


@pytest.mark.parametrize("delay_s", [0.0, 0.01, 0.03, 0.05])
def test_gains_for_a_delay_keep_their_margin(delay_s: float) -> None:
    k, d = call(gains_for_delay, SAFETY.hold_stiffness, DAMPING, delay_s)
    assert call(delay_margin, k, d, EXCESS) > 1.3 * delay_s
    if delay_s <= 0.01:
        assert (k, d) == (SAFETY.hold_stiffness, DAMPING)


def test_gains_for_a_delay_are_never_too_soft_to_rest() -> None:
    k, d = call(gains_for_delay, SAFETY.hold_stiffness, DAMPING, 1e9)
    assert (k, d) == pytest.approx((SLOWEST**2 * SAFETY.hold_stiffness, SLOWEST * DAMPING))


# -- in the simulation --------------------------------------------------------------------------------


def hold_in_motion(name: str, rate_hz: float, delay_s: float, behind_s: float = 0.0) -> tuple[float, float]:
    """Let a foreign command stop the law in full motion while joint states get late; return what comes of it.

    `behind_s`: how much the simulation falls behind the controller's clock at that moment; nothing is delayed by it.
    Fastest joint from 1 s after that on [rad/s], and largest slip [m].
    """
    period = 1.0 / rate_hz
    changes = [f"{node}.control_period_s={period}" for node in ("bridge", "controller")]
    changes += [
        "controller.gains.k_s=20.0",
        "controller.trajectory.duration_s=1.35",
        "bridge.stop_after_duration=false",
    ]
    scenario = load_scenario(name, mode="realtime", assignments=tuple(changes))
    bridge, controller = begun_bridge(scenario), realtime(scenario)
    way, delay = deque[TickOutputs](), round(delay_s * rate_hz)
    stopped, rested, end = (round(t * rate_hz) for t in (0.4, 1.4, 1.8))
    fastest = slip = 0.0
    command = None
    for tick in range(end):
        now_ns = STEADY_NS + round((tick * period + (behind_s if tick >= stopped else 0.0)) * 1e9)
        outputs = bridge.observe()
        way.append(outputs)
        if tick == stopped:
            assert controller.mode.follows
            controller.set_publishers({}, 2)
        if tick >= rested:
            fastest = max(fastest, float(np.abs(outputs.arms[0].joint.velocity).max()))
        slip = max(slip, float(np.abs(outputs.truth.slip_displacement[:3]).max()))
        while len(way) > (delay if tick >= stopped else 0):
            command = answered_outputs(controller, way.popleft(), now_ns).command
        bridge.advance([command])
    assert controller.mode == Mode.FAULT
    assert controller.reason == "effort command has another publisher"
    return fastest, slip


def test_the_arm_rests_though_joint_states_are_late() -> None:
    for name in SCENARIOS:
        for rate_hz, delay_s in ((100.0, 0.0), (100.0, BORNE_S), (250.0, BORNE_S)):
            fastest, slip = hold_in_motion(name, rate_hz, delay_s)
            assert fastest < REST_RAD_S, (name, rate_hz, delay_s)
            assert slip < 0.07, (name, rate_hz, delay_s)  # nothing is thrown away


def test_no_load_is_believed_to_be_metres_from_where_it_was_told_to_be() -> None:
    told = Vec(0.1, -0.2, 0.3)
    for slid in (Vec(0.0, 0.0, 0.0), Vec(0.06, -0.07, 0.0)):
        assert plausible_arm(told, told + slid) == told + slid  # to the last bit
    far = plausible_arm(told, told + Vec(2.02, -1.33, 0.0)) - told
    assert far.norm() == pytest.approx(LOAD_LEVER, rel=CLOSE)
    assert far.cross(Vec(2.02, -1.33, 0.0)).norm() < CLOSE


def test_late_joint_states_end_the_law_where_that_is_asked_for() -> None:
    """And the law comes back with them; without the parameter it stays at work."""
    for late_s, expected in ((0.012, Mode.HOLD), (0.0, Mode.ACTIVE)):
        changes = [f"{node}.control_period_s=0.004" for node in ("bridge", "controller")]
        changes += ["controller.gains.k_s=20.0", f"controller.safety.inputs.joint.late_s={late_s}"]
        scenario = load_scenario("paper_planar", mode="realtime", assignments=tuple(changes))
        bridge, controller = begun_bridge(scenario), realtime(scenario)
        results = []
        for tick in range(120):
            behind_ns = 20 * MS if 50 <= tick < 70 else 0
            results.append(answered_outputs(controller, bridge.observe(), STEADY_NS + tick * 4 * MS + behind_ns))
            bridge.advance([results[-1].command])
        assert results[49].mode == Mode.ACTIVE
        assert results[60].mode == expected
        assert ("joint state is late" in results[60].reason) == (late_s > 0.0)
        assert results[-1].mode.follows
