"""Slip observer: the model predicts slip at control rate, sensor samples correct it at their own time stamps.

Two hypotheses share one filter per axis. In stick the slip velocity is zero at every tick, which teaches the filter the
model's errors (wrench bias, wrong mass). In slip the velocity is free, and a sample of stamp t_m corrects the estimate
as it was at t_m; the ticks since then are run again. A significance test on what the model says and one on the samples
decide between the two, so that noise cannot open the gate.

On pad axes throughout; only the axes in which the contact can slip are filtered. This is the plain form: it documents
the kernels behind `observer_memory`, which run, and is their referee.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slip_core.arrays import Array
from slip_core.types import SlipSample
from slip_vic_controller.core.observer_run import insert, run
from slip_vic_controller.core.observer_types import (
    Floats,
    Moment,
    Motion,
    ObserverConfig,
    ObserverState,
    Sample,
    SlipEstimate,
)
from slip_vic_controller.core.slip_filter_kernel import AxisFilter, correct, learn


def initial_observer(config: ObserverConfig, stamp_ns: int, v_ee: Array) -> ObserverState:
    """Return the state before the first tick: stick, model errors unknown; v_ee (6,) {w}.

    Implements: ours: a grasp begins without slip.
    """
    estimate = tuple(
        AxisFilter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, c) for b, c in zip(config.prior_b, config.prior_c, strict=True)
    )
    zero = (0.0,) * len(config.axes)
    return ObserverState(stamp_ns, False, estimate, v_ee, zero, stamp_ns, 0, (), 0)


def observe(
    config: ObserverConfig, state: ObserverState, motion: Motion, samples: Sequence[SlipSample]
) -> tuple[ObserverState, SlipEstimate]:
    """Take in one tick and the samples that came with it, in any order; return the next state and the estimate.

    Implements: ours: v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), corrected at the samples' stamps.
    """
    fresh = sorted(Sample(s.stamp_ns, tuple(s.twist[list(config.axes)].tolist())) for s in samples if s.valid)
    moment = _moment(config, state, motion)
    state = state._replace(stamp_ns=motion.stamp_ns, twist=motion.v_ee)
    state, significance = (_in_slip if state.sliding else _in_stick)(config, state, moment, fresh)
    return state, _estimate(config, state, moment.force, significance)


def last_twist(config: ObserverConfig, state: ObserverState) -> Array:
    """Return the slip velocity of the last tick as the law was given it; (6,) [m/s, rad/s] {ee}.

    Implements: ours: what the next prediction starts from.
    """
    twist = np.zeros(6)
    if state.sliding:
        for i, x in zip(config.axes, state.estimate, strict=True):
            twist[i] = x.v
    return twist


def _in_stick(
    config: ObserverConfig, state: ObserverState, moment: Moment, fresh: list[Sample]
) -> tuple[ObserverState, float]:
    """Test whether slip has begun. What the model says of the last ticks counts only once they have passed as stick.

    Were it taken in at once, the beginning of a slip would be learnt as an error of the model.
    """
    window, known = (*state.history, moment), state.estimate
    if len(window) > config.window:
        oldest, window = window[0], window[1:]
        known = tuple(
            learn(x, step, f, oldest.dt, q_v, q_b)
            for x, step, f, q_v, q_b in zip(
                known, oldest.step, oldest.force, config.force_noise, config.drift_b, strict=True
            )
        )
    significance = _window_significance(config, window, known)
    mean, seen = _listen(config, state.mean, [s for s in fresh if s.stamp_ns > state.since_ns])
    if significance > config.chi_on:
        history = run(config, window, 0, _unsettled(config, known, moment))
        return state._replace(sliding=True, estimate=history[-1].estimate, history=history, mean=mean), significance
    if seen:
        known = _restart(config, known, mean)
        history = (moment._replace(estimate=known),)
        return state._replace(sliding=True, estimate=known, history=history, mean=mean), significance
    return state._replace(estimate=known, history=window, mean=mean), significance


def _unsettled(config: ObserverConfig, known: tuple[AxisFilter, ...], moment: Moment) -> tuple[AxisFilter, ...]:
    """Return the estimate with the doubt that a slip begins with: what was learnt holds for the forces of stick.

    Forces and torques come in other proportions now, so a wrong centre of mass shows in another way.
    """
    force = math.sqrt(sum(f * f for f in moment.drag))
    return tuple(x._replace(P_bb=x.P_bb + (gain * force) ** 2) for x, gain in zip(known, config.onset_b, strict=True))


def _in_slip(
    config: ObserverConfig, state: ObserverState, moment: Moment, fresh: list[Sample]
) -> tuple[ObserverState, float]:
    """Predict, correct, and test whether the slip is over."""
    oldest = moment.stamp_ns - config.memory_ns
    keep = next((i for i, m in enumerate(state.history) if m.stamp_ns >= oldest), len(state.history) - 1)
    history = (*state.history[keep:], moment)
    usable = [s for s in fresh if s.stamp_ns > history[0].stamp_ns]
    first = len(history) - 1
    if usable:
        history, first = insert(history, usable)
    history = run(config, history, first, history[first - 1].estimate)
    estimate = history[-1].estimate
    late = state.late + len(fresh) - len(usable)
    significance = _significance(estimate, config.floor)
    # Doubt is not rest: control holds the estimate near zero, so only a model that has been confirmed can tell. Nor is
    # an insignificant speed a small one where the doubt about it is large: v = 0 would be believed without a reason.
    known = all(
        x.P_bb < most and x.P_vv < speed for x, most, speed in zip(estimate, config.rest, config.calm, strict=True)
    )
    quiet = state.quiet + 1 if known and significance < config.chi_off else 0
    if quiet < config.dwell:
        return state._replace(estimate=estimate, history=history, quiet=quiet, late=late), significance
    rest = tuple(correct(x, 0.0, floor) for x, floor in zip(estimate, config.floor, strict=True))
    rest = tuple(x._replace(v=0.0, P_vv=0.0, P_vb=0.0, P_vc=0.0) for x in rest)
    zero = (0.0,) * len(rest)
    return ObserverState(moment.stamp_ns, False, rest, state.twist, zero, moment.stamp_ns, 0, (), late), significance


def _moment(config: ObserverConfig, state: ObserverState, motion: Motion) -> Moment:
    """Return what this tick does to the slip velocity, whatever that is; the estimate is filled in later."""
    dt = (motion.stamp_ns - state.stamp_ns) * 1e-9
    R = motion.R_ee
    change = (((motion.v_ee - state.twist) - dt * motion.follow).reshape(2, 3) @ R).ravel().tolist()
    force_pad = (motion.force.reshape(2, 3) @ R).ravel().tolist()
    w_ee, w_o = (R.T @ motion.v_ee[3:]).tolist(), (R.T @ motion.w_o).tolist()
    turn_linear = tuple(a + 2.0 * b for a, b in zip(w_ee, w_o, strict=True))
    turn_angular = tuple(a + b for a, b in zip(w_ee, w_o, strict=True))
    step = tuple(change[i] for i in config.axes)
    force = tuple(force_pad[i] for i in config.axes)
    drag_pad = (motion.drag @ R).tolist()
    drag = tuple(drag_pad[i] for i in config.axes if i < 3)
    time, steps, impulses = dt, step, tuple(dt * f for f in force)
    if state.history:
        last = state.history[-1]
        time += last.time
        steps = tuple(a + b for a, b in zip(last.steps, steps, strict=True))
        impulses = tuple(a + b for a, b in zip(last.impulses, impulses, strict=True))
    return Moment(
        motion.stamp_ns, dt, time, steps, impulses, step, turn_linear, turn_angular, force, drag, (), ()
    )  # fmt: skip


def _window_significance(config: ObserverConfig, window: tuple[Moment, ...], known: tuple[AxisFilter, ...]) -> float:
    """Return the significance of the velocity that the window adds up to, from v = 0 at its beginning."""
    first, last = window[0], window[-1]
    time = last.time - first.time + first.dt
    total = 0.0
    for k, (x, q_v, floor) in enumerate(zip(known, config.force_noise, config.floor, strict=True)):
        impulse = last.impulses[k] - first.impulses[k] + first.dt * first.force[k]
        v = last.steps[k] - first.steps[k] + first.step[k] - time * x.b - impulse * x.c
        variance = time * time * x.P_bb + 2.0 * time * impulse * x.P_bc + impulse * impulse * x.P_cc
        total += v * v / (variance + len(window) * q_v + floor)
    return total


def _listen(config: ObserverConfig, mean: Floats, fresh: list[Sample]) -> tuple[Floats, bool]:
    """Return the weighted mean with new samples in it, and whether it was significant after any of them."""
    share = config.smoothing / (2.0 - config.smoothing)  # variance of the weighted mean over that of a sample
    seen = False
    for sample in fresh:
        mean = tuple(m + config.smoothing * (value - m) for m, value in zip(mean, sample.values, strict=True))
        seen = seen or sum(m * m / (share * R) for m, R in zip(mean, config.noise, strict=True)) > config.chi_on
    return mean, seen


def _significance(estimate: tuple[AxisFilter, ...], floor: Floats) -> float:
    return sum(x.v * x.v / (x.P_vv + least) for x, least in zip(estimate, floor, strict=True))


def _restart(config: ObserverConfig, estimate: tuple[AxisFilter, ...], mean: Floats) -> tuple[AxisFilter, ...]:
    """Return an estimate that believes the samples: the model has missed a slip, so its errors are unknown again."""
    share = config.smoothing / (2.0 - config.smoothing)
    return tuple(
        AxisFilter(m, x.b, x.c, share * R + m * m, 0.0, 0.0, b, 0.0, c)
        for x, m, R, b, c in zip(estimate, mean, config.noise, config.prior_b, config.prior_c, strict=True)
    )


def _estimate(config: ObserverConfig, state: ObserverState, force: Floats, significance: float) -> SlipEstimate:
    twist, error, variance = np.zeros(6), np.zeros(6), np.zeros(6)
    for i, x, f in zip(config.axes, state.estimate, force, strict=True):
        if state.sliding:
            twist[i] = x.v
        error[i] = x.b + x.c * f
        variance[i] = x.P_vv
    return SlipEstimate(twist, error, variance, significance, state.sliding)
