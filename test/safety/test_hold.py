"""HOLD with late joint states: the promised delay, its closed form, and how lateness is seen."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import pytest

from slip_bringup.scenario import load_scenario
from slip_campaigns.faults.trial import START_NS, STEADY_NS
from slip_core.arrays import skew
from slip_sim_bridge.session import BridgeSession, TickOutputs
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.hold import (
    EXCESS,
    LOAD_LEVER,
    SLOWEST,
    bearable_gains,
    delay_margin,
    held_inertia,
    load_error,
)
from slip_vic_controller.core.lateness import DECAY_S, Lateness, answered
from slip_vic_controller.core.modes import Mode
from slip_vic_controller.core.session import ControllerSession
from slip_vic_controller.safety_params import SafetyParams

from .delivery import answered_outputs

SAFETY = SafetyParams()
BORNE_S = 0.020  # docs/safety.md
REST_RAD_S = 0.1  # what the campaign calls rest, a second after the law
MS = 1_000_000


def hold_in_motion(name: str, rate_hz: float, delay_s: float, behind_s: float = 0.0) -> tuple[float, float, str]:
    """Let a foreign command stop the law in full motion while joint states get late; return what comes of it.

    `behind_s`: how much the simulation falls behind the controller's clock at that moment; nothing is delayed by it.
    Fastest joint from 1 s after that on [rad/s], largest slip [m], and the reason of the mode.
    """
    period = 1.0 / rate_hz
    changes = [f"{node}.control_period_s={period}" for node in ("bridge", "controller")]
    changes += [
        "controller.gains.k_s=20.0",
        "controller.trajectory.duration_s=1.35",
        "bridge.stop_after_duration=false",
    ]
    scenario = load_scenario(name, mode="realtime", assignments=tuple(changes))
    bridge = BridgeSession(scenario.bridge, scenario.urdf)
    bridge.start_at(START_NS)
    controller = ControllerSession(VicController(scenario.controller, scenario.urdf), lockstep=False)
    way, delay = deque[TickOutputs](), round(delay_s * rate_hz)
    stopped, rested, end = (round(t * rate_hz) for t in (0.4, 1.4, 1.8))
    fastest = slip = 0.0
    command = None
    for tick in range(end):
        now_ns = STEADY_NS + round((tick * period + (behind_s if tick >= stopped else 0.0)) * 1e9)
        outputs = bridge.observe()
        way.append(outputs)
        if tick == stopped:
            controller.monitor.set_publishers({}, 2)
        if tick >= rested:
            fastest = max(fastest, float(np.abs(outputs.joint.velocity).max()))
        slip = max(slip, float(np.abs(outputs.truth.slip_displacement[:3]).max()))
        while len(way) > (delay if tick >= stopped else 0):
            command = answered_outputs(controller, way.popleft(), now_ns).command
        bridge.advance(command)
    assert controller.mode == Mode.FAULT
    assert controller.safety is not None
    return fastest, slip, controller.safety.mode.reason


@pytest.mark.parametrize("rate_hz", [100.0, 250.0])
@pytest.mark.parametrize("name", ["paper_planar", "vertical_plane", "glass_transport"])
def test_the_arm_rests_though_joint_states_are_late(name: str, rate_hz: float) -> None:
    for delay_s in (0.0, BORNE_S):
        fastest, slip, _ = hold_in_motion(name, rate_hz, delay_s)
        assert fastest < REST_RAD_S, delay_s
        assert slip < 0.07, delay_s  # nothing is thrown away


@pytest.mark.parametrize("name", ["vertical_plane", "glass_transport"])
def test_later_joint_states_get_softer_gains(name: str) -> None:
    fastest, _, _ = hold_in_motion(name, 250.0, 2.0 * BORNE_S)
    assert fastest < REST_RAD_S


@pytest.mark.parametrize("name", ["paper_planar", "vertical_plane", "glass_transport"])
@pytest.mark.parametrize("behind_s", [0.2, 2.0])
def test_the_arm_rests_though_the_simulation_is_behind_the_clock(name: str, behind_s: float) -> None:
    """Old stamps without a delay in the loop: the gains must not go to zero with them."""
    fastest, slip, _ = hold_in_motion(name, 250.0, 0.0, behind_s)
    assert fastest < REST_RAD_S
    assert slip < 0.05  # the campaigns call more than that lost


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
    margin = delay_margin(k, d, excess)
    assert response(k, d, excess, 0.93 * margin) < 0.2
    assert response(k, d, excess, 1.07 * margin) > 5.0


def test_the_page_promises_what_the_gains_bear() -> None:
    at_100_hz = BORNE_S + 0.005  # half a period more: a command is held for one
    assert delay_margin(SAFETY.hold_stiffness, SAFETY.hold_damping, EXCESS) > at_100_hz


@pytest.mark.parametrize("delay_s", [0.0, 0.01, 0.03, 0.05])
def test_bearable_gains_keep_their_margin(delay_s: float) -> None:
    k, d = bearable_gains(SAFETY.hold_stiffness, SAFETY.hold_damping, delay_s)
    assert delay_margin(k, d, EXCESS) > 1.3 * delay_s
    if delay_s <= 0.01:
        assert (k, d) == (SAFETY.hold_stiffness, SAFETY.hold_damping)


def test_bearable_gains_are_never_too_soft_to_rest() -> None:
    k, d = bearable_gains(SAFETY.hold_stiffness, SAFETY.hold_damping, 1e9)
    assert (k, d) == (SLOWEST**2 * SAFETY.hold_stiffness, SLOWEST * SAFETY.hold_damping)


@pytest.mark.parametrize("seed", range(5))
def test_held_inertia_is_that_of_the_arm_and_half_of_a_rigid_object(seed: int) -> None:
    """By the kinetic energy of both bodies."""
    rng = np.random.default_rng(seed)
    root, inertia_root = rng.standard_normal((7, 7)), 0.1 * rng.standard_normal((3, 3))
    M, J, r, qd = root @ root.T, rng.standard_normal((6, 7)), rng.standard_normal(3), rng.standard_normal(7)
    inertia, mass = inertia_root @ inertia_root.T, 0.7
    v, w = (J @ qd)[:3], (J @ qd)[3:]
    at_object = v - np.cross(w, r)
    energy = 0.5 * (mass * at_object @ at_object + w @ inertia @ w)
    found = 0.5 * qd @ held_inertia(M, J, r, mass, inertia) @ qd
    assert found == pytest.approx(0.5 * qd @ M @ qd + 0.5 * energy, rel=1e-12)
    np.testing.assert_allclose(skew(r) @ w, -np.cross(w, r), atol=1e-12)


def test_a_real_grasp_is_within_the_assumed_excess() -> None:
    for name in ("paper_planar", "vertical_plane", "glass_transport"):
        scenario = load_scenario(name)
        law = VicController(scenario.controller, scenario.urdf)
        arm = law.arm.terms(np.array(scenario.bridge.initial_position), np.zeros(7))
        contact, model = law.contacts[0], law.object_model
        R_o = arm.rotation @ contact.rotation.T
        inertia = held_inertia(arm.M, arm.J, R_o @ contact.position, model.mass, R_o @ model.inertia @ R_o.T)
        assert np.linalg.eigvals(np.linalg.solve(arm.M, inertia)).real.max() < EXCESS


def test_the_wrench_corrects_the_load_slowly_and_by_no_more_than_the_weight() -> None:
    model, error = np.array([0.0, 0.0, -4.0, 0.1, 0.0, 0.0]), np.zeros(6)
    measured = model + np.array([0.5, 0.0, 0.3, 0.0, 0.05, 0.0])
    for _ in range(100):
        error = load_error(error, model, measured, 0.004, 0.1)
    np.testing.assert_allclose(error, (1.0 - math.exp(-4.0)) * (measured - model), atol=1e-12)
    wild = 1e6 * np.ones(6)
    for _ in range(1000):
        error = load_error(error, model, wild, 0.004, 0.1)
    assert np.linalg.norm(error[:3]) <= 4.0 + 1e-9
    assert np.linalg.norm(error[3:]) <= 4.0 * LOAD_LEVER + 1e-9


class TestLateness:
    """`answered`, with made-up clocks."""

    def run(self, took_ms: list[float], memory: Lateness, *, offset_ns: int = 123) -> Lateness:
        for k, took in enumerate(took_ms):
            now_ns = 1_000 * MS + k * 4 * MS + offset_ns
            memory = answered(memory, now_ns, now_ns - round(took * MS) - offset_ns, 4 * MS, 12 * MS)
        return memory

    def test_clocks_need_not_agree(self) -> None:
        memory = self.run([5.0] * 20, Lateness(), offset_ns=10**15)
        assert memory.last_ns == 0
        assert memory.most_ns == 0

    def test_one_late_answer_does_not_count_and_five_do(self) -> None:
        good = self.run([1.0] * 20, Lateness())
        assert self.run([30.0], good).most_ns == 0
        late = self.run([30.0] * 6, good)
        assert late.in_a_row == 5
        assert late.most_ns == pytest.approx(29 * MS, rel=1e-2)

    def test_a_lasting_delay_is_not_forgotten_and_one_that_ends_is(self) -> None:
        late = self.run([30.0] * 5000, self.run([1.0] * 20, Lateness()))
        assert late.last_ns == pytest.approx(29 * MS, rel=1e-2)
        over = self.run([1.0] * round(5 * DECAY_S / 0.004), late)
        assert over.in_a_row == 0
        assert over.most_ns < 0.02 * late.most_ns

    def test_clocks_that_drift_apart_are_not_late(self) -> None:
        memory = Lateness()
        for k in range(100_000):
            stamp_ns = k * 4 * MS
            memory = answered(memory, stamp_ns + round(2e-4 * stamp_ns), stamp_ns, 4 * MS, 12 * MS)
        assert memory.most_ns < 1 * MS


def test_late_joint_states_end_the_law_where_that_is_asked_for() -> None:
    """And the law comes back with them; without the parameter it stays at work."""
    for late_s, expected in ((0.012, Mode.HOLD), (0.0, Mode.ACTIVE)):
        changes = [f"{node}.control_period_s=0.004" for node in ("bridge", "controller")]
        changes += ["controller.gains.k_s=20.0", f"controller.safety.inputs.joint.late_s={late_s}"]
        scenario = load_scenario("paper_planar", mode="realtime", assignments=tuple(changes))
        bridge = BridgeSession(scenario.bridge, scenario.urdf)
        bridge.start_at(START_NS)
        controller = ControllerSession(VicController(scenario.controller, scenario.urdf), lockstep=False)
        modes = []
        for tick in range(200):
            behind_ns = 20 * MS if 50 <= tick < 70 else 0
            now_ns = STEADY_NS + tick * 4 * MS + behind_ns
            outputs = bridge.observe()
            result = answered_outputs(controller, outputs, now_ns)
            modes.append(result.mode)
            bridge.advance(result.command)
        assert modes[49].mode == Mode.ACTIVE
        assert modes[60].mode == expected
        assert ("joint state is late" in modes[60].reason) == (late_s > 0.0)
        assert modes[-1].mode.follows
