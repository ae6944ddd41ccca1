"""Evidence of slip from the wrench, without a slip sensor: an object slips if its load is less than its motion needs.

Without slip the object moves with the pad, and the contact carries l(a), the load of that motion. A contact that slips
carries only its friction, whatever the motion. So a load that stays below what the motion needs indicates slip, or a
wrong mass. With means over MEAN_S of the measured load l and of the load that the pad's acceleration needs:

    D = u . mean l(a_pad) + min(u . b, 0),   lack = (D - |mean l|) / max(D, LEAST_FRICTION F)
    S <- max(0, S + dt (lack - SCATTERS)),   a slip where S > LACKS_S      (cumulative sum: E. S. Page, 1954)

u is along mean l. What friction carries is |mean l| while S grows, in the mean. b is the difference of the means,
measured minus needed, from the last time when the measured load was the larger one: friction carries no more than the
motion needs, so that was a bias of the wrench. It explains part of a lack.

The command is not used: a blocked arm does not follow it, and drives that overshoot make an object slide that their
commands would carry. Along mean l the noise of joint velocities in the needed load has zero mean, its norm has not.
While the observer finds slip, the whole lack counts: the observer has learnt the errors that SCATTERS allows for.

Assumptions: one arm; mass and wrench accurate to SCATTERS beyond b (a tare ensures both if the weight is not in the
slip plane). A wrong mass lowers friction only once, by its relative error, until a load that counts has been carried in
full. Needed loads below LEAST_FRICTION F are not judged: there a bias of the wrench may be all of the lack.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Vec6, Whole
from slip_core.vectors import Spatial, put_spatial, spatial
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.contact.friction_estimate import LEAST_FRICTION
from slip_vic_controller.sizes import NEVER

MEAN_S: Final = 0.05
"""Time constant of the means [s]: wrench noise of 0.05 N leaves 5 mN in them, which is 10 % of the smallest judged load
if friction carries 0.15 N. A slip is found about as much later."""
SCATTERS: Final = 0.03
"""Allowed lack of load [1]. With 0.1 an object on 0.9 of the friction slides 17 mm farther unseen, and in 118 frozen
worlds it slips 1.02 mm in the mean instead of 0.85; as many are lost."""
LACKS_S: Final = 0.01
"""Sum that counts as slip [s]: a lack of 20 % for 60 ms, of 50 % for 21 ms."""


class WrenchEvidence(Record):
    """Load that the pad's motion needed, and load that the contact carried."""

    begun: Whole  # whether `twist` is known
    twist: Vec6  # m/s, rad/s {w}; of the pad in the cycle before
    needed: Vec6  # N, mean on pad axes; what the pad's acceleration needs
    measured: Vec6  # N, mean on pad axes
    added: Vec6  # N, mean on pad axes; what drives add to the load of the commands
    surplus: Vec6  # N, b
    sum_s: Real  # S
    kept: Real  # N, mean of the load that was carried while S grew
    spent: Whole  # whether a slip was found, and no load that counts has been carried in full since
    unseen_ns: Whole  # since when the slip sensor has shown nothing of it, NEVER = it has


@part
def start_evidence(state: WrenchEvidence) -> None:
    """Start without load and slip."""
    state.begun, state.sum_s, state.kept, state.spent, state.unseen_ns = 0, 0.0, 0.0, 0, NEVER
    state.twist[:], state.needed[:], state.measured[:] = 0.0, 0.0, 0.0
    state.added[:], state.surplus[:] = 0.0, 0.0


@part
def pull(state: WrenchEvidence) -> Spatial:
    """Return the mean load minus the one that the pad's motion needs [N] {ee}.

    At rest, above LEAST_FRICTION F and the wrench's expected bias, it comes from a hand: a wrong mass leaves less.
    """
    return spatial(state.measured) - spatial(state.needed)


@part
def take_in(mean: Vec6, value: Spatial, dt: float) -> Spatial:
    """Take a value into a mean [N] {ee}, and return that; dt: since the cycle before [s]."""
    share = min(1.0 - math.exp(-dt / MEAN_S), SCATTERS)  # one sample, e.g. an encoder's step, is no lack
    put_spatial(mean, spatial(mean) + share * (value - spatial(mean)))
    return spatial(mean)


@part
def lacks_load(
    state: WrenchEvidence, contact: ContactEstimate, needed: Spatial, measured: Spatial, F: float,
    found: bool, stamp_ns: int, dt: float,
) -> bool:  # fmt: skip
    """Update with the loads of a cycle; return whether they show a slip that was not known.

    Args:
        state: changed.
        contact: whether the slip sensor shows slip; the load needed and the one carried are written to it.
        needed: load of the acceleration that the pad has, turning at the torsional radius [N] {ee}.
        measured: the load [N] {ee}.
        F: load that friction was taken to carry at first [N].
        found: whether the observer finds slip.
        stamp_ns: of this cycle.
        dt: since the cycle before [s].
    """
    need, load = take_in(state.needed, needed, dt), take_in(state.measured, measured, dt)
    if contact.slipping != 0:
        state.sum_s, state.unseen_ns = 0.0, NEVER
        return False
    carried, D = math.sqrt(load.dot(load)), 0.0
    if carried > 0.0:
        D = need.dot(load) / carried
        if carried >= D:
            put_spatial(state.surplus, load - need)
        D += min(spatial(state.surplus).dot(load) / carried, 0.0)
    counts = max(D, LEAST_FRICTION * F)
    lack = (D - carried) / counts - (0.0 if found else SCATTERS)
    state.sum_s = min(max(state.sum_s + dt * lack, 0.0), 2.0 * LACKS_S)
    if lack > 0.0:
        state.kept += dt * lack / max(state.sum_s, dt * lack) * (carried - state.kept)
    if state.sum_s == 0.0 and counts == D:
        state.spent = 0
    if state.sum_s <= LACKS_S or state.spent != 0 or counts > D:
        return False
    state.spent, contact.needs, contact.lacks = 1, D, state.kept
    if state.unseen_ns == NEVER:
        state.unseen_ns = stamp_ns
    return True
