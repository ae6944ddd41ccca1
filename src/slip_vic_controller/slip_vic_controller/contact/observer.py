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
from slip_core.vectors import Spatial, Vec, mat, put, put_spatial, spatial, vec
from slip_vic_controller.contact.axis import Axis, put_axis, read_axis
from slip_vic_controller.contact.history import append
from slip_vic_controller.contact.layouts import AXES, ROW, TICK_ROW, Motion, Observer, ObserverConfig, Row
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
    for i in range(AXES):
        state.twist[i], state.error[i], state.variance[i], state.sample_mean[i] = 0.0, 0.0, 0.0, 0.0
        state.v_ee[i] = v_ee[i]
        P_bb, P_cc = (config.prior_P_bb[i], config.prior_P_cc[i]) if config.axes[i] else (0.0, 0.0)
        put_axis(state.axes[i], Axis(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, P_bb, 0.0, P_cc))


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
        samples: of the own contact, in any order.
        count: how many of them there are.
    """
    rows = records(history, ROW)
    dt = (stamp_ns - state.stamp_ns) * 1e-9
    state.stamp_ns = stamp_ns
    if state.sliding:
        drop_old_rows(config, state, rows, count)
    describe_tick(config, state, motion, dt, append(state, history, rows))
    for i in range(6):
        state.v_ee[i] = motion.v_ee[i]
    if not are_small(config, samples, count):
        return False
    if state.sliding:
        observe_slip(config, state, history, rows, samples, count)
    else:
        observe_stick(config, state, rows, samples, count)
    publish(config, state, motion)
    return is_small(state)


@part
def filtered(config: ObserverConfig, s: Spatial) -> Spatial:
    """Return the components on filtered axes, zero on the others."""
    a, b = s.linear, s.angular
    return Spatial(
        Vec(a.x if config.axes[0] else 0.0, a.y if config.axes[1] else 0.0, a.z if config.axes[2] else 0.0),
        Vec(b.x if config.axes[3] else 0.0, b.y if config.axes[4] else 0.0, b.z if config.axes[5] else 0.0),
    )


@part
def force_on_pad(config: ObserverConfig, motion: Motion) -> Spatial:
    """Return the specific force on the filtered axes; [m/s^2, rad/s^2] {ee}."""
    return filtered(config, mat(motion.rotation).T() @ spatial(motion.force))


@part
def describe_tick(config: ObserverConfig, state: Observer, motion: Motion, dt: float, row: Row) -> None:
    """Write what a tick does to the slip velocity, whatever that is: dv_ee - dt (G^T a_o + Phi2), and Phi1'; {ee}."""
    to_pad = mat(motion.rotation).T()
    v_ee = spatial(motion.v_ee)
    w_ee, w_o = to_pad @ v_ee.angular, to_pad @ vec(motion.w_o)
    step = v_ee - spatial(state.v_ee) - dt * spatial(motion.follow)
    drag = Spatial(to_pad @ vec(motion.drag), Vec(0.0, 0.0, 0.0))
    row.stamp_ns, row.kind, row.dt = state.stamp_ns, TICK_ROW, dt
    put(row.turn_linear, w_ee + 2.0 * w_o)
    put(row.turn_angular, w_ee + w_o)
    put(row.drag, filtered(config, drag).linear)
    put_spatial(row.step, filtered(config, to_pad @ step))
    put_spatial(row.force, force_on_pad(config, motion))
    row.velocity_variance[:], row.change_variance[:] = motion.velocity_variance, motion.change_variance


@part
def publish(config: ObserverConfig, state: Observer, motion: Motion) -> None:
    """Write what the law is given: slip velocity, zero in stick; error b + c f of `follow`; variance."""
    force = force_on_pad(config, motion)
    for i in range(AXES):
        x = state.axes[i]
        f = force.linear[i] if i < 3 else force.angular[i - 3]
        state.twist[i] = x.v if state.sliding else 0.0
        state.error[i] = x.b + x.c * f
        state.variance[i] = x.P_vv


@part
def are_small(config: ObserverConfig, samples: Records[StampedSlip], count: int) -> bool:
    """Return whether every reading on a filtered axis is finite and its square is."""
    small = True
    for k in range(count):
        for i in range(AXES):
            small = small and (not config.axes[i] or abs(samples[k].twist[i]) <= LARGEST)
    return small


@part
def is_small(state: Observer) -> bool:
    """Return whether every number of the state is finite and its square is."""
    small = state.significance <= LARGEST
    for i in range(AXES):
        x = state.axes[i]
        small = small and abs(state.v_ee[i]) <= LARGEST and abs(state.sample_mean[i]) <= LARGEST
        small = small and abs(state.error[i]) <= LARGEST
        for number in read_axis(x):
            small = small and abs(number) <= LARGEST
    return small
