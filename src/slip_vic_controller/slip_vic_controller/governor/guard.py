"""The guard scales the control acceleration so that it never loads the contact with more than friction carries."""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.vectors import Mat, Spatial, Vec, put_spatial, spatial
from slip_vic_controller.governor.layouts import GovernedPad, GovernorConfig
from slip_vic_controller.governor.load import Held, drawn, size, turning, weight
from slip_vic_controller.governor.plan import Governing

BRAKES: Final = 1.1
"""Of the load of the weight alone, if the estimated friction does not carry it: the arm has to brake."""


@part
def guard_factor(drawn: Spatial, rest: Spatial, F: float) -> float:
    """Return the largest k in [0, 1] with |k l_a + l_0| <= F.

    If even k = 0 is too much (weight and turning alone), the k with the smallest load.

    Args:
        drawn: l_a, what the control acceleration draws [N].
        rest: l_0, load of weight and turning [N].
        F: [N].
    """
    a, b, c = drawn.dot(drawn), drawn.dot(rest), rest.dot(rest) - F * F
    if a + 2.0 * b + c <= 0.0 or a <= 0.0:
        return 1.0
    if c > 0.0:  # beyond the limit at k = 0
        d = b * b - a * c
        if b >= 0.0 or d < 0.0:
            return min(max(-b / a, 0.0), 1.0)
        return min((math.sqrt(d) - b) / a, 1.0)
    root = math.sqrt(b * b - a * c)
    return -c / (b + root) if b > 0.0 else (root - b) / a


@part
def hold_back(
    config: GovernorConfig,
    ceiling: float,
    pad: GovernedPad,
    held: Held,
    R_ee: Mat,
    w_ee: Vec,
    a_C: Spatial,
    a_d: Spatial,
    slides: bool,
) -> float:
    """Return the guard's factor on a_C, and store the commanded feedback and load.

    What drives add to the command, such as joint friction that nothing compensates, is load too. Without it, an arm
    that is held back would keep giving way to it.

    Args:
        config: GOVERNOR_CONFIG.
        ceiling: load that the guard lets pass [N].
        pad: PAD.
        held: object on pad axes.
        R_ee, w_ee: the pad's attitude and turning {w} [rad/s].
        a_C, a_d: control acceleration of the law, and the reference's in it {w}.
        slides: whether the object slides; then the factor is 1.

    Implements: ours: the load of the commanded acceleration and of what drives add never exceeds F^ unless it
    slides.
    """
    l_a = drawn(held, R_ee, a_C)
    l_0 = turning(held, R_ee, w_ee) + weight(held, R_ee)
    k = 1.0
    if config.mode != Governing.OFF and not slides:
        rest = l_0 + spatial(pad.evidence.added) if config.disturbed != 0 else l_0
        alone = size(rest)  # an object that holds shows that the limit is wrong, and one that slides needs no guard
        k = guard_factor(l_a, rest, ceiling if alone <= ceiling else BRAKES * alone)
    commanded = k * l_a + l_0
    put_spatial(pad.drawn, commanded)
    pad.guard, pad.commanded = k, size(commanded)
    put_spatial(pad.feedback, a_C - a_d)
    return k
