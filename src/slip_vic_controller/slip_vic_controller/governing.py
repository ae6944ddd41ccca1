"""The reference governor in the cycle: what it is told of grasp, path and slip, and the reference that it gives."""

from __future__ import annotations

import math
from typing import Any

from slip_core.compiled import part
from slip_core.records import REAL, layout
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, spatial, vec
from slip_vic_controller.law.contact import contact_arm, pad_rotation
from slip_vic_controller.law.internal import sharing
from slip_vic_controller.reference import governor
from slip_vic_controller.reference.friction_estimate import slip_sample
from slip_vic_controller.reference.load import ALONE, Held, Shared, load, size, surface
from slip_vic_controller.reference.path_grid import Along, along
from slip_vic_controller.reference.paths import Reference, reference_at

GOVERNED = layout(
    path_s=REAL, path_rate=REAL, friction_limit=REAL, load_commanded=REAL, load_measured=REAL, load_ratio=REAL,
    guard=REAL, friction_events=REAL, given_up=REAL,
)  # fmt: skip
"""What is published of the governor: where on the path and how fast; F^, loads commanded and measured [N], commanded
load over F^; the guard's factor on a_C; how often F^ was made smaller; whether the compensation is given up."""
UNLIMITED = 1e3
"""A speed along the path that limits nothing."""
OBSERVED = 0.5
"""Share of the threshold that a slip sample must show where the observer has found slip: two witnesses."""
SAMPLES_PER_CYCLE = 10
"""Points of the path that are sampled in a cycle."""


@part
def held_by(mass: float, inertia: Mat, position: Vec, contact: Any, slip: Any) -> Held:
    """Return the object on the axes of the pad that holds it.

    Args:
        mass, inertia: [kg], [kg m2] {o}.
        position: of the contact on the object, o_x_p [m] {o}.
        contact, slip: CONTACT, SLIP.
    """
    pad = pad_rotation(contact, slip)
    return Held(mass, pad.T() @ (inertia @ pad), contact_arm(pad, position, contact, slip), ALONE)


@part
def held(c: Any, s: Any, gains: Any) -> Held:
    """Return the object as the own pad holds it."""
    grasped, position = gains.object, vec(gains.contact_position)
    own = held_by(grasped.mass, mat(grasped.inertia), position, c.law.contact[0], s.law.slips[0])
    if c.law.contacts == 1:
        return own
    with_others, rho = sharing(c.law, gains, s.law.slips), c.governor.radius
    arm = math.sqrt(with_others.longest * with_others.longest + rho * rho)
    shared = Shared(with_others.contacts, with_others.middle, with_others.inverse, arm, rho)
    return Held(own.mass, own.inertia, own.r, shared)


@part
def begin_governing(c: Any, s: Any, arm: Any, gains: Any) -> None:
    """Begin with the load of the object at rest; c, s: CONFIG and STATE of the cycle."""
    weights = surface(spatial(c.governor.slip_axes), c.governor.radius)
    nothing = Spatial(ZERO, ZERO)
    at_rest = load(held(c, s, gains), weights, mat(arm.rotation), ZERO, vec(c.governor.gravity), nothing)
    governor.start_governor(c.governor, s.governor, s.loads, size(at_rest))


@part
def rest_on_path(c: Any, s: Any) -> None:
    """Go on from rest where the path is."""
    s.governor.rate = 0.0
    governor.steady(c.governor, s.governor)


@part
def path_at(c: Any, s: Any, time: float) -> Reference:
    """Return the trajectory as planned at its own time [s]."""
    return reference_at(c.path, time, s.law.start_position, s.law.start_rotation)


@part
def along_path(c: Any, planned: Reference, time: float) -> Along:
    """Return a point of the path over s."""
    return along(c.governor, time, planned.rotation, planned.twist, planned.acceleration)


@part
def govern(c: Any, s: Any, arm: Any, o: Any, grasped: Held, dt: float, path_speed: float) -> None:
    """Do the governor's cycle: loads, slip samples, planning, and the step on the path.

    Args:
        c, s, o: CONFIG, STATE and OUTPUTS of the cycle.
        arm: ARM.
        grasped: the object, from `held`.
        dt: since the cycle before [s].
        path_speed: how fast the path may be run through for other reasons; 1 = not limited, 0 = come to rest.
    """
    state, stamp_ns = s.governor, s.joint.answers.stamp_ns
    share = OBSERVED if c.cycle.has_observer != 0 and s.observer.sliding != 0 else 1.0
    governor.feel(c.governor, state, s.loads, spatial(o.samples[0].wrench), stamp_ns)
    for k in range(s.queue.count):
        sample = s.queue.samples[k]
        v = spatial(c.governor.slip_axes) * spatial(sample.twist)
        turning = c.governor.radius * v.angular.norm()
        speed = math.sqrt(v.linear.dot(v.linear) + turning * turning)
        slip_sample(c.governor.estimate, state.estimate, s.loads, sample.stamp_ns, speed / share)
    if state.led != 0:  # another arm on the same object has taken the step on the path
        return
    for _ in range(SAMPLES_PER_CYCLE):
        if governor.wants_points(state):
            planned = path_at(c, s, governor.wanted_time(c.governor, state))
            governor.next_point(
                c.governor, state, s.grid, grasped, planned.rotation, planned.twist, planned.acceleration
            )
    if (stamp_ns - s.law.start_ns) * 1e-9 < c.cycle.start_s:  # the trajectory rests first
        governor.plan(c.governor, state, s.grid)
        return
    planned = path_at(c, s, state.time)
    most_rate = UNLIMITED if path_speed >= 1.0 else path_speed * max(state.rate, c.governor.floor)
    governor.run(
        c.governor, state, s.grid, grasped, along_path(c, planned, state.time), vec(arm.position) - planned.position,
        mat(arm.rotation), spatial(arm.twist), most_rate, dt if dt > 0.0 else 1e-9 * c.cycle.period_ns,
    )  # fmt: skip


@part
def governed_reference(c: Any, s: Any) -> Reference:
    """Return the reference where the governor has it."""
    state = s.governor
    planned = path_at(c, s, state.out_time)
    twist, acceleration = governor.governed(state, along_path(c, planned, state.out_time))
    return Reference(planned.position, planned.rotation, twist, acceleration)


@part
def guard(c: Any, s: Any, arm: Any, o: Any, grasped: Held) -> float:
    """Return the factor on a_C with which friction carries the object, and keep what the next cycle needs of it."""
    a_C, a_d, v_ee = spatial(o.law.a_C), spatial(o.law.a_d), spatial(arm.twist)
    if c.law.contacts > 1:
        # What gives way to the internal wrench moves no object; and one arm that holds back alone would pull at it.
        gains = o.gains.gains
        a_C = a_C - gains.kappa * (mat(arm.rotation) @ spatial(o.law.h_int)) / spatial(gains.M_D)
        governor.hold_back(c.governor, s.governor, grasped, mat(arm.rotation), v_ee.angular, a_C, a_d)
        s.governor.guard = 1.0
        return 1.0
    return governor.hold_back(c.governor, s.governor, grasped, mat(arm.rotation), v_ee.angular, a_C, a_d)


@part
def put_governed(c: Any, s: Any, out: Any) -> None:
    """Write what is published of the governor to a GOVERNED."""
    state = s.governor
    out.path_s, out.path_rate, out.guard = state.out_s, state.out_rate, state.guard
    out.friction_limit, out.friction_events = state.estimate.F_hat, float(state.estimate.events)
    out.load_commanded, out.load_measured = state.commanded, state.measured
    out.given_up = float(s.law.given_up.given_up)
    out.load_ratio = state.commanded / state.estimate.F_hat if state.estimate.F_hat > 0.0 else 0.0
