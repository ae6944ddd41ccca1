"""The Gymnasium environment slip_vic/Carry-v0: carry an object along a path and let it slip little.

    import gymnasium
    env = gymnasium.make("slip_vic.gym:slip_vic/Carry-v0", scenario="paper_planar", sensor="vision_60")

Needs the extra `gym`. The loop is that of your own law: the torque law converts the action to an effort, which the
effort limiter bounds.
"""

from __future__ import annotations

import importlib
from typing import Any, ClassVar, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.params import Assignments, parse_assignments
from slip_vic.experiments.driven import driven
from slip_vic.experiments.law import Pad, Seen, Setup
from slip_vic.run.in_process import Tick
from slip_vic.run.judge import LawError
from slip_vic.run.metrics import ARRIVED
from slip_vic.scenarios.scenario import load

gymnasium: Any = importlib.import_module("gymnasium")  # it is optional, so that mypy need not find it

TICKS: Final = 10
"""Control periods for which an action is held: 100 Hz (ours)."""
LINEAR: Final = 5.0
ANGULAR: Final = 20.0
"""Acceleration of an action of 1 [m/s2], [rad/s2] (ours: more than any scenario needs)."""
OBSERVED: Final = 38


class _Hand:
    """The law that holds an action."""

    needs: ClassVar[frozenset[str]] = frozenset({"wrench", "slip", "grip"})

    def reset(self, setup: Setup) -> None:
        self.setup, self.answer = setup, Pad(np.zeros(6))

    def step(self, seen: Seen) -> Pad:
        self.seen = seen
        return self.answer


class Carry(gymnasium.Env):
    """Carries an object with one arm.

    {w} are the axes of the world, {ee} those of the pad: x out of the hand, z the closing direction. Action (7,), each
    from -1 to 1: acceleration of the pad that is added to the path's, {w}; squeeze, from none to the largest.
    Observation (38,), SI units, {w} except wrench and slip, {ee}: error of the pad's pose (6), of its twist (6), twist
    and acceleration of the path (12), wrench (6), slip velocity (6), squeeze over the largest, fraction of the path's
    time. Reward of a step: minus its time times (100 slip speed + 10 error + squeeze over the largest), with 0.03 m for
    a radian (ours). Terminated if the object is lost; truncated at the end of the scenario. info: slip [m], [rad], and
    success: the object is held, and the pad is within 1 mm and 0.5 degrees of the path's end.

    A step takes about 9 ms of a core. `gymnasium.make_vec(..., vectorization_mode="async")` gives each a core.

    Args:
        scenario: with one arm; sensor: slip sensor; set: assignments, as in `slip_vic.load`.
        duration_s: of an episode [s].
        render_mode: None.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self, scenario: str = "paper_planar", sensor: str = "vision_60", set: Assignments = (),
        duration_s: float = 4.0, render_mode: None = None,
    ) -> None:  # fmt: skip
        self.render_mode = render_mode
        self._name, self._sensor = scenario, sensor
        self._set = dict(parse_assignments(set)) | {"bridge.duration_s": duration_s}
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (7,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVED,), np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; the seed is that of the sensors' noise."""
        super().reset(seed=seed)
        noise = int(self.np_random.integers(2**31))
        scenario = load(self._name, law="classical", sensor=self._sensor, seed=noise, set=self._set)
        if scenario.several:
            raise InputError("Carry-v0: scenario", got=self._name, expected="a scenario with one arm")
        self._hand = _Hand()
        self._ticks = driven(scenario, self._hand)
        tick = next(self._ticks)
        return self._observed(), self._info(tick)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold an action for ten control periods."""
        hand, given = self._hand, np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        most = hand.setup.most_grip
        change = np.concatenate((LINEAR * given[:3], ANGULAR * given[3:6]))
        grip, reward, tick = 0.5 * (1.0 + float(given[6])) * most, 0.0, None
        for _ in range(TICKS):
            path = hand.setup.reference(hand.seen.time + hand.setup.period_s)
            hand.answer = Pad(path.acceleration + change, grip)
            try:
                tick = next(self._ticks, None)
            except LawError:  # an action without a finite effort
                return self._observed(), reward, True, False, self._last | {"success": False}
            if tick is None:
                break
            self._info(tick)
            reward -= hand.setup.period_s * (
                100.0 * _size(tick.outputs.arms[0].readings.truth.slip_velocity)
                + 10.0 * _size(hand.seen.way_to(hand.setup.reference(hand.seen.time))) + grip / most
            )  # fmt: skip
            if any(one.kind in ("lost", "fault") for one in tick.incidents):
                return self._observed(), reward, True, False, self._last | {"success": False}
        return self._observed(), reward, False, tick is None, self._last

    def _observed(self) -> Array:
        seen, setup = self._hand.seen, self._hand.setup
        path = setup.reference(seen.time)
        share = min(seen.time / max(setup.duration_s, setup.period_s), 1.0)
        errors = seen.way_to(path), path.twist - seen.twist
        parts = (*errors, path.twist, path.acceleration, seen.wrench, seen.slip)
        return np.concatenate((*parts, [seen.grip / setup.most_grip, share])).astype(np.float32)

    def _info(self, tick: Tick) -> dict[str, Any]:
        slip = np.array(tick.outputs.arms[0].readings.truth.slip_displacement)
        left = self._hand.seen.way_to(self._hand.setup.reference(self._hand.setup.duration_s))
        self._last = {
            "slip_m": float(np.linalg.norm(slip[:3])),
            "slip_rad": float(np.linalg.norm(slip[3:])),
            "success": bool(np.linalg.norm(left[:3]) < ARRIVED[0] and np.linalg.norm(left[3:]) < ARRIVED[1]),
        }
        return self._last


def _size(six: Array) -> float:
    """Return a length [m] or speed [m/s] of both parts, 0.03 m for a radian."""
    return float(np.hypot(np.linalg.norm(six[:3]), 0.03 * np.linalg.norm(six[3:])))


if "slip_vic/Carry-v0" not in gymnasium.registry:
    gymnasium.register("slip_vic/Carry-v0", entry_point=Carry)
