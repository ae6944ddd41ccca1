"""The tare: what the sensors read while HOLD keeps the arms at rest, and what of that is a bias."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.compiled import part
from slip_core.vectors import ZERO, Spatial, Vec, mat, put_spatial, vec
from slip_vic_controller.arm.tare import add, add_slip, measure_at_rest, start_tare, take_biases
from slip_vic_controller.cycle.wrench import arm_of_load, tared_wrench
from slip_vic_controller.law.contact import pad_rotation
from slip_vic_controller.safety.hold import object_load
from slip_vic_controller.safety.modes import Mode, Request, follows
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmCycle, Arms


class AtRest(NamedTuple):
    """What the wrenches of all arms show together at rest; of one, and after the tare of all, nothing.

    arms: how many; known: whether all hold it and all are measured; beyond: force beyond the weight of the object, a
    share of it for each arm [N] {w}. What is left of a single wrench may be internal: arms may press on each other.
    """

    arms: int
    known: bool
    beyond: Vec


@part
def all_at_rest(arms: Arms) -> AtRest:
    """Return what the wrenches of all arms show together at rest."""
    configs, states = arms.configs, arms.states
    n, held, wanted, beyond = len(configs), configs[0].tare.duration_ns > 0, False, ZERO
    for k in range(n):
        held = held and states[k].mode.mode == Mode.HOLD and states[k].wrench_inputs[0].seen != 0
        wanted = wanted or states[k].tare.done == 0
    if n == 1 or not held or not wanted:
        return AtRest(n, n == 1, ZERO)
    for k in range(n):
        R = mat(arms.inputs[k].arm.rotation)
        beyond = beyond + (R @ tared_wrench(configs[k], states[k], R).linear - vec(configs[k].hold.weight))
    return AtRest(n, True, (1.0 / n) * beyond)


@part
def tare(c: ArmCycle, together: AtRest) -> bool:
    """Read the sensors at rest while HOLD keeps the arm, and take what is a bias out of the samples of this cycle.

    Returns whether the object's weight was found, and is another than before.
    """
    config, state, inputs = c.config, c.state, c.inputs
    tare, queue, mass_share = state.tare, state.queue, state.tare.mass_share
    if inputs.request == Request.TARE and not follows(state.mode.mode):
        start_tare(tare, NEVER)
        tare.watched = 0
    n, last = config.law.joints, state.joint.last
    if tare.done == 0 and state.mode.mode == Mode.HOLD:
        stamp_ns, wrench = state.joint.answers.stamp_ns, state.wrench_inputs[0]
        paused = inputs.now_ns - state.now_ns > config.conditions.gap_ns  # something else may have moved the arm
        if tare.watched == 0 or paused:
            tare.watched, tare.watched_from[:] = 1, state.joint.answers.position
        six, (beyond, expected) = np.zeros(6), _wrench_at_rest(c, together)
        over = measure_at_rest(config.tare, tare, stamp_ns, last.position[:n], last.velocity[:n])
        for k in range(queue.count):
            if queue.samples[k].stamp_ns >= tare.begun_ns:
                add_slip(config.tare, tare, queue.samples[k].twist)
        if wrench.stamp_ns > tare.wrench_ns and together.known:
            tare.wrench_ns = wrench.stamp_ns
            put_spatial(six, beyond)
            add(tare.wrench, six, 6)
        if over:
            put_spatial(six, expected)
            take_biases(config.tare, tare, six, stamp_ns, last.position[:n])
    elif tare.done == 0:
        tare.watched, tare.begun_ns = 0, NEVER
    for k in range(queue.count):
        for i in range(6):
            queue.samples[k].twist[i] -= tare.slip.bias[i]
    return bool(tare.mass_share != mass_share)


@part
def _wrench_at_rest(c: ArmCycle, together: AtRest) -> tuple[Spatial, Spatial]:
    """Return the object's wrench on the pad beyond that of the model, and that of the model [N, N m] {ee}.

    Of several arms a share of what they show together, in which torques are not compared.
    """
    config, state, R = c.config, c.state, mat(c.inputs.arm.rotation)
    r = arm_of_load(config, state, pad_rotation(config.law.contact[0], state.law.slips[0]))
    expected = object_load(config.hold, R, R @ r)
    if together.arms == 1:
        return tared_wrench(config, state, R) - expected, expected
    return Spatial(R.T() @ together.beyond, ZERO), Spatial(expected.linear, ZERO)
