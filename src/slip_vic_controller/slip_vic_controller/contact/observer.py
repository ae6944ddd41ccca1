"""The slip observer: the model predicts slip at control rate, sensor samples correct it at their own time stamps.

Two hypotheses share one filter per axis. In stick the slip velocity is zero at every tick, which teaches the filters
the model's errors (wrench bias, wrong mass). In slip the velocity is free, and a sample of stamp t_m corrects the
estimate as it was at t_m; the ticks since then are run again. A test of the normalised innovation squared, on what the
model says and on the samples, decides between the two, so that noise does not activate the compensation.

On pad axes throughout; only the axes in which the contact can slip are filtered.
"""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST
from slip_core.compiled import part
from slip_core.records import Records, records
from slip_core.vectors import ZERO, Spatial, mat, put, put_spatial, spatial, vec
from slip_vic_controller.contact.axis import forget_errors, put_velocity
from slip_vic_controller.contact.history import append
from slip_vic_controller.contact.layouts import ROW, Motion, Observer, ObserverConfig, Row
from slip_vic_controller.contact.slip import drop_old_rows, observe_slip
from slip_vic_controller.contact.stick import observe_stick
from slip_vic_controller.law.contact import StampedSlip


@part
def reset(config: ObserverConfig, state: Observer, stamp_ns: int, v_ee: Array) -> None:
    """Begin without slip, the model's errors unknown.

    Args:
        config: tuning.
        state: overwritten.
        stamp_ns: of the tick before the first one.
        v_ee: twist of the pad at it; (6,) [m/s, rad/s] {w}.
    """
    state.stamp_ns, state.since_ns = stamp_ns, stamp_ns
    state.sliding, state.quiet, state.late, state.first, state.rows = 0, 0, 0, 0, 0
    state.significance = 0.0
    state.twist[:], state.error[:], state.variance[:], state.sample_mean[:] = 0.0, 0.0, 0.0, 0.0
    state.v_ee[:] = v_ee
    for i in range(6):
        x, shown = state.axes[i], config.axes[i]
        put_velocity(x, 0.0, 0.0)
        forget_errors(x, shown * config.prior_P_bb[i], shown * config.prior_P_cc[i])
        x.b, x.c = 0.0, 0.0


@part
def observe(
    config: ObserverConfig, state: Observer, history: Array, motion: Motion, stamp_ns: int,
    samples: Records[StampedSlip], count: int,
) -> bool:  # fmt: skip
    """Take in one tick and the samples that came with it; return whether every number of the state is finite.

    Args:
        config: tuning.
        state: overwritten; where the result is False it is undefined.
        history: (capacity, ROW_SIZE) float64, zeros in the beginning; belongs to the state, overwritten.
        motion: of this tick.
        stamp_ns: of this tick, not before the last one.
        samples: of the own contact, in the order of their stamps.
        count: how many of them there are.
    """
    rows, to_pad = records(history, ROW), mat(motion.rotation).T()
    dt, state.stamp_ns = (stamp_ns - state.stamp_ns) * 1e-9, stamp_ns
    force = spatial(config.axes) * (to_pad @ spatial(motion.force))
    if state.sliding:
        drop_old_rows(config, state, rows)
    row = append(state, history, rows)
    describe_tick(config, state, motion, dt, row)
    put_spatial(row.force, force)
    state.v_ee[:] = motion.v_ee
    if state.sliding:
        observe_slip(config, state, rows, samples, count)
    else:
        observe_stick(config, state, rows, samples, count)
    return publish(state, force)


@part
def describe_tick(config: ObserverConfig, state: Observer, motion: Motion, dt: float, row: Row) -> None:
    """Write what a tick does to the slip velocity, whatever that is: dv_ee - dt (G^T a_o + Phi2), and Phi1'; {ee}."""
    to_pad, axes, v_ee = mat(motion.rotation).T(), spatial(config.axes), spatial(motion.v_ee)
    w_ee, w_o = to_pad @ v_ee.angular, to_pad @ vec(motion.w_o)
    step = v_ee - spatial(state.v_ee) - dt * spatial(motion.follow)
    row.stamp_ns, row.dt = state.stamp_ns, dt
    put(row.turn_linear, w_ee + 2.0 * w_o)
    put(row.turn_angular, w_ee + w_o)
    put(row.drag, (axes * Spatial(to_pad @ vec(motion.drag), ZERO)).linear)
    put_spatial(row.step, axes * (to_pad @ step))
    row.velocity_variance[:], row.change_variance[:] = motion.velocity_variance, motion.change_variance


@part
def publish(state: Observer, force: Spatial) -> bool:
    """Write what the law is given; return whether every number of the state is finite and its square is.

    That is the slip velocity, zero in stick, the error b + c f of `follow` at a specific force, and the variance.
    """
    size = state.significance
    for i in range(6):
        x = state.axes[i]
        state.twist[i] = x.v if state.sliding else 0.0
        state.error[i] = x.b + x.c * (force.linear[i] if i < 3 else force.angular[i - 3])
        state.variance[i] = x.P_vv
        size += abs(x.v) + abs(x.b) + abs(x.c) + x.P_vv + x.P_bb + x.P_cc
        size += abs(state.error[i]) + abs(state.v_ee[i]) + abs(state.sample_mean[i])
    return size <= LARGEST
