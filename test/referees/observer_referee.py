"""The slip observer once more, slowly and plainly: full matrices, lists of ticks, everything since t_m run again.

Written from the same equations as what runs, with other means: the filters of all axes as one array, F P F^T + Q by
matrix products, the window added up directly, the history as a list of ticks that keep their samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from test.referees import kalman_referee as kalman

LEAST_SHARE = 1e-3  # of an axis across the friction force, below which its direction says nothing of it


@dataclass
class Tick:
    """What a tick did to the slip velocity on the filtered axes, its samples, and in slip the estimate with them."""

    stamp_ns: int
    dt: float
    step: np.ndarray
    force: np.ndarray
    turn: np.ndarray
    drag: np.ndarray
    samples: list[tuple[int, tuple[float, ...]]] = field(default_factory=list)
    contradicts: list[bool] = field(default_factory=list)
    after: list[np.ndarray] = field(default_factory=list)
    x: np.ndarray | None = None
    P: np.ndarray | None = None


def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


class ObserverReferee:
    """The observer as a class with a memory.

    Args:
        config: OBSERVER_CONFIG record.
        stamp_ns, v_ee: of the tick before the first one.
    """

    def __init__(self, config, stamp_ns: int, v_ee) -> None:
        self.config = config = SimpleNamespace(**{name: config[name].tolist() for name in config.dtype.names})
        self.axes = np.flatnonzero(config.axes)
        self.linear = self.axes[self.axes < 3]
        self.block = np.ix_(self.axes, self.axes)
        n = len(self.axes)
        for name in (
            "measurement_variance", "process_variance", "drift_variance", "floor_variance", "stick_P_bb", "stick_P_vv",
            "prior_P_bb", "prior_P_cc", "onset_gain", "dead_band",
        ):  # fmt: skip
            setattr(self, name, np.array(getattr(config, name))[self.axes])
        self.share = config.smoothing / (2.0 - config.smoothing)
        self.stamp_ns, self.since_ns, self.v_ee = stamp_ns, stamp_ns, np.array(v_ee)
        self.x, self.P = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self.P[:, 1, 1], self.P[:, 2, 2] = self.prior_P_bb, self.prior_P_cc
        self.sliding, self.quiet, self.late, self.significance = False, 0, 0, 0.0
        self.sample_mean, self.history = np.zeros(n), []
        self.twist, self.error, self.variance = np.zeros((3, 6))

    def observe(self, motion, stamp_ns: int, samples) -> None:
        """Take in a tick, a MOTION record, and its samples: pairs of stamp and twist (6,)."""
        tick = self._tick(motion, stamp_ns)
        self.stamp_ns, self.v_ee = stamp_ns, motion["v_ee"].copy()
        fresh = sorted((s, tuple(np.asarray(twist)[self.axes].tolist())) for s, twist in samples)
        (self._slip if self.sliding else self._stick)(tick, fresh)
        self.twist, self.error, self.variance = np.zeros((3, 6))
        if self.sliding:
            self.twist[self.axes] = self.x[:, 0]
        self.error[self.axes] = self.x[:, 1] + self.x[:, 2] * tick.force
        self.variance[self.axes] = self.P[:, 0, 0]

    def _tick(self, motion, stamp_ns: int) -> Tick:
        dt = (stamp_ns - self.stamp_ns) * 1e-9
        R, v_ee = motion["rotation"], motion["v_ee"]

        def on_pad(twist):
            return (twist.reshape(2, 3) @ R).ravel()

        w_ee, w_o = v_ee[3:] @ R, motion["w_o"] @ R
        turn = np.zeros((6, 6))
        turn[:3, :3], turn[3:, 3:] = skew(w_ee + 2.0 * w_o), skew(w_ee + w_o)
        step, force = on_pad(v_ee - self.v_ee - dt * motion["follow"]), on_pad(motion["force"])
        drag = motion["drag"] @ R
        return Tick(stamp_ns, dt, step[self.axes], force[self.axes], turn[self.block], drag[self.linear])

    # -- stick
    def _stick(self, tick: Tick, fresh) -> None:
        self.history.append(tick)
        if len(self.history) > self.config.window_ticks:
            self._zero_velocity_update(self.history.pop(0))
        self.significance = self._window_significance()
        seen = False
        for stamp_ns, values in fresh:
            if stamp_ns > self.since_ns:
                R = self.share * self.measurement_variance
                step = self.config.smoothing * (np.array(values) - self.sample_mean)
                over = np.sqrt(np.sum(step**2 / R) / self.config.nis_slip) / self.config.most_step
                self.sample_mean += step / max(over, 1.0)
                total = np.sum(self.sample_mean**2 / R)
                if total > self.config.nis_slip and over > 1.0:
                    self.sample_mean = np.array(values)
                if total > self.config.nis_slip:
                    seen = True
        if self.significance > self.config.nis_slip:
            self.P[:, 1, 1] += (self.onset_gain * np.sqrt(np.sum(tick.drag**2))) ** 2
            self.sliding = True
            self._run(0)
        elif seen:
            n, m = len(self.axes), self.sample_mean
            self.history = [tick]
            self.x[:, 0] = m
            self.P = np.zeros((n, 3, 3))
            self.P[:, 0, 0] = self.share * self.measurement_variance + m**2
            self.P[:, 1, 1], self.P[:, 2, 2] = self.prior_P_bb, self.prior_P_cc
            self.sliding = True
            self.history[0].x, self.history[0].P = self.x, self.P
            self._run(1)

    def _zero_velocity_update(self, tick: Tick) -> None:
        q_v, q_b = self.process_variance, self.drift_variance
        x, P = kalman.predict(self.x, self.P, tick.step, tick.force, tick.dt, q_v, q_b)
        self._at_rest(*kalman.correct(x, P, np.zeros(len(x)), np.zeros(len(x))))

    def _at_rest(self, x, P) -> None:
        x[:, 0], P[:, 0, :], P[:, :, 0] = 0.0, 0.0, 0.0
        self.x, self.P = x, P

    def _window_significance(self) -> float:
        total = 0.0
        time = sum(t.dt for t in self.history)
        steps, impulses = sum(t.step for t in self.history), sum(t.dt * t.force for t in self.history)
        for k, (x, P) in enumerate(zip(self.x, self.P, strict=True)):
            H = np.array([0.0, time, impulses[k]])
            v = steps[k] - H @ x
            S = H @ P @ H + len(self.history) * self.process_variance[k] + self.floor_variance[k]
            total += v * v / S
        return total

    # -- slip
    def _slip(self, tick: Tick, fresh) -> None:
        while len(self.history) > 1 and self.history[0].stamp_ns < tick.stamp_ns - self.config.memory_ns:
            self.history.pop(0)
        self.history.append(tick)
        first = len(self.history) - 1
        for sample in fresh:
            if sample[0] <= self.history[0].stamp_ns:
                self.late += 1
                continue
            k = next((k for k, t in enumerate(self.history) if t.stamp_ns >= sample[0]), len(self.history) - 1)
            self.history[k].samples = sorted([*self.history[k].samples, sample])
            first = min(first, k)
        self.x, self.P = self.history[first - 1].x, self.history[first - 1].P
        self._run(first)
        if fresh and self._contradicted():
            return
        P_vv = self.P[:, 0, 0]
        self.significance = float(np.sum(self.x[:, 0] ** 2 / (P_vv + self.floor_variance)))
        confirmed = np.all((self.P[:, 1, 1] < self.stick_P_bb) & (P_vv < self.stick_P_vv))
        self.quiet = self.quiet + 1 if confirmed and self.significance < self.config.nis_stick else 0
        if self.quiet >= self.config.dwell_ticks:
            self._end_slip()

    def _end_slip(self) -> None:
        self._at_rest(*kalman.correct(self.x, self.P, np.zeros(len(self.x)), self.floor_variance))
        self.sliding, self.quiet, self.since_ns = False, 0, self.stamp_ns
        self.sample_mean, self.history = np.zeros(len(self.x)), []

    def _contradicted(self) -> bool:
        """Believe the three newest samples where all contradict the estimate; return whether they say rest."""
        newest = [(k, i) for k, tick in enumerate(self.history) for i in range(len(tick.samples))][-3:]
        if len(newest) < 3 or not all(self.history[k].contradicts[i] for k, i in newest):
            return False
        values = np.array([self.history[k].samples[i][1] for k, i in newest])
        rest = np.sum(values.sum(axis=0) ** 2 / (3 * self.measurement_variance)) < self.config.nis_slip
        if rest:
            self._end_slip()
            self.P = self._model_unknown(np.zeros(len(self.x)))
            return True
        k, i = newest[0]
        z, tick = values[0], self.history[k]
        linear = self.axes < 3
        read = np.where(linear, np.any(z[linear]), np.any(z[~linear]))
        band = np.where(read, 0.0, self.dead_band)
        self.x = tick.after[i].copy()
        self.x[:, 0] = z
        first = self.x
        self.P = self._model_unknown(self.measurement_variance + band**2)
        tick.samples = tick.samples[i:]
        self._take_samples(tick, 1)
        tick.contradicts, tick.after = [True, *tick.contradicts], [first, *tick.after]
        tick.x, tick.P, self.history = self.x, self.P, self.history[k:]
        self._run(1)
        return False

    def _model_unknown(self, P_vv) -> np.ndarray:
        P = np.zeros((len(self.axes), 3, 3))
        P[:, 0, 0], P[:, 1, 1], P[:, 2, 2] = P_vv, self.prior_P_bb, self.prior_P_cc
        return P

    def _run(self, first: int) -> None:
        for tick in self.history[first:]:
            step = tick.step - tick.dt * (tick.turn @ self.x[:, 0])
            q_v, q_b = self.process_variance, self.drift_variance
            self.x, self.P = kalman.predict(self.x, self.P, step, tick.force, tick.dt, q_v, q_b)
            self._oppose(tick)
            self._take_samples(tick, 0)
            tick.x, tick.P = self.x, self.P

    def _take_samples(self, tick: Tick, first: int) -> None:
        tick.contradicts, tick.after = [], []
        for _, values in tick.samples[first:]:
            tick.contradicts.append(self._correct(np.array(values)))
            tick.after.append(self.x)

    def _oppose(self, tick: Tick) -> None:
        """Friction opposes slip: v is on the side of d, and along it."""
        n = len(self.linear)
        d = tick.drag + self.x[:n, 1] + self.x[:n, 2] * tick.force[:n]
        square = d @ d
        if self.config.friction_spread == 0.0 or square == 0.0:
            return
        v = self.x[:n, 0]
        along = (v @ d) / square
        across = 1.0 - d * d / square if along > 0.0 else np.ones(n)
        spread = self.config.friction_spread**2 * (v @ v)
        told = across > LEAST_SHARE
        R = self.config.friction_memory_ticks * (spread + self.floor_variance[:n][told]) / across[told]
        k = np.flatnonzero(told)
        x, P = self.x.copy(), self.P.copy()
        x[k], P[k] = kalman.correct(x[k], P[k], max(along, 0.0) * d[k], R)
        self.x, self.P = x, P

    def _correct(self, z) -> bool:
        """Take a sample in; return whether it contradicts the estimate."""
        x, P = self.x.copy(), self.P.copy()
        beyond = False
        for half in (self.axes < 3, self.axes >= 3):
            dead = not np.any(z[half])
            for k in np.flatnonzero(half):
                R = self.measurement_variance[k]
                band = self.dead_band[k] if dead else 0.0
                excess = max(abs(z[k] - x[k, 0]) - band, 0.0)
                beyond = beyond or excess**2 > self.config.outlier_deviations**2 * (P[k, 0, 0] + R)
                if dead and self.dead_band[k] > 0.0:
                    x[k], P[k] = kalman.correct_within(x[k], P[k], self.dead_band[k], R)
                else:
                    R = kalman.robust_variance(x[k], P[k], z[k], R, self.config.outlier_deviations)
                    x[k], P[k] = kalman.correct(x[k], P[k], z[k], np.asarray(R))
        self.x, self.P = x, P
        return beyond
