"""What the wrench shows without a slip sensor: an object that gets less load than its motion needs slips.

While nothing slips the object moves with the pad, and the contact carries l(a), the load of that motion. A contact that
slips carries what friction has, and that does not grow with what is asked. So a load that stays below the one that the
motion needs is a slip, or a mass that is wrong. With means over MEAN_S of the load l that is measured, of the one that
was commanded, and of the one that the pad's own acceleration needs, u along mean l:

    D = min(mean |l(a_commanded)|, u . mean l(a_pad)),   lack = (D - |mean l|) / max(D, LEAST_FRICTION F)
    S <- max(0, S + dt (lack - SCATTERS)),   a slip where S > LACKS_S      (cumulative sum: E. S. Page, 1954)

Both motions have to need it: an arm that is stuck is commanded to accelerate and does not, and noise of joint
velocities accelerates where nothing is commanded. What the pad's motion needs counts along the load that is measured:
noise of joint velocities makes the size of a vector larger, and of a component it has no mean.
While the observer finds slip, all that is missing counts: it has learnt the errors for which SCATTERS makes room.

Assumptions: one arm, whose mass and wrench are right to SCATTERS (a tare sees to both where the weight is not in the
slip plane). What a wrong mass claims is believed once, until a load that counts has been carried in full: it costs the
share of the load by which the mass is wrong, and no more. A load below LEAST_FRICTION F is none that friction ends at,
but what a bias of the wrench leaves of a small one.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Vec6, Whole, dtype_of
from slip_core.vectors import Spatial, put_spatial, spatial
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.contact.friction_estimate import LEAST_FRICTION
from slip_vic_controller.sizes import NEVER

MEAN_S: Final = 0.05
"""Memory of the means [s]: noise of a wrench of 0.05 N counts 5 mN in them, which is 10 % of the least load that counts
where friction carries 0.15 N. A slip is found about as much later."""
SCATTERS: Final = 0.1
"""Share of the load that may be missing [1]: in runs without slip the means lack up to a fifth for moments, never a
tenth for long."""
LACKS_S: Final = 0.01
"""Sum at which it is a slip [s]: 20 % missing for 0.1 s, 50 % for 25 ms. Half of it finds a slip 60 ms earlier, and
slips in 1 of 10 runs that have none."""


@unique
class Handover(IntEnum):
    """What the arm does where a hand pulls at the object."""

    HOLD = 0
    FOLLOW = 1
    OPEN = 2


class WrenchEvidence(Record):
    """What has been asked of the contact, and what it carried."""

    begun: Whole  # whether `twist` is known
    twist: Vec6  # m/s, rad/s {w}; of the pad in the cycle before
    commanded: Real  # N, mean
    needed: Vec6  # N, mean on pad axes; what the pad's acceleration needs
    measured: Vec6  # N, mean on pad axes
    sum_s: Real  # S
    spent: Whole  # whether a slip was found, and no load that counts has been carried in full since
    unseen_ns: Whole  # since when the slip sensor has shown nothing of it, NEVER = it has


WRENCH_EVIDENCE = dtype_of(WrenchEvidence)


@part
def start_evidence(state: WrenchEvidence) -> None:
    """Begin: nothing has been asked, and nothing has slipped."""
    state.begun, state.commanded, state.sum_s, state.spent, state.unseen_ns = 0, 0.0, 0.0, 0, NEVER
    state.twist[:], state.needed[:], state.measured[:] = 0.0, 0.0, 0.0


@part
def pull(state: WrenchEvidence) -> Spatial:
    """Return the mean load beyond the one that the pad's motion needs [N] {ee}.

    At rest it is a hand's, from LEAST_FRICTION F on: what a wrong mass or the bias after a tare leaves there is less.
    """
    return spatial(state.measured) - spatial(state.needed)


@part
def lacks_load(
    state: WrenchEvidence, contact: ContactEstimate, commanded: float, needed: Spatial, measured: Spatial, F: float,
    found: bool, stamp_ns: int, dt: float,
) -> bool:  # fmt: skip
    """Take in the loads of a cycle; return whether they show a slip that was not known.

    Args:
        state: changed.
        contact: whether the slip sensor shows slip; the load needed and the one carried are written to it.
        commanded: load of the command that led to this cycle [N].
        needed: load of the acceleration that the pad has, turning at the torsional radius [N] {ee}.
        measured: the load [N] {ee}.
        F: load that friction was taken to carry at first [N].
        found: whether the observer finds slip.
        stamp_ns: of this cycle.
        dt: since the cycle before [s].
    """
    share = 1.0 - math.exp(-dt / MEAN_S)
    state.commanded += share * (commanded - state.commanded)
    need, load = spatial(state.needed), spatial(state.measured)
    need, load = need + share * (needed - need), load + share * (measured - load)
    put_spatial(state.needed, need)
    put_spatial(state.measured, load)
    if contact.slipping != 0:
        state.sum_s, state.unseen_ns = 0.0, NEVER
        return False
    carried = math.sqrt(load.dot(load))
    D = min(state.commanded, need.dot(load) / carried) if carried > 0.0 else 0.0
    counts = max(D, LEAST_FRICTION * F)
    lack = (D - carried) / counts - (0.0 if found else SCATTERS)
    state.sum_s = min(max(state.sum_s + dt * lack, 0.0), 2.0 * LACKS_S)
    if state.sum_s == 0.0 and counts == D:
        state.spent = 0
    if state.sum_s <= LACKS_S or state.spent != 0 or carried < LEAST_FRICTION * F:
        return False
    state.spent, contact.needs, contact.lacks = 1, D, carried
    if state.unseen_ns == NEVER:
        state.unseen_ns = stamp_ns
    return True
