"""The guard: the last scaling of a control acceleration: it never loads the contact with more than friction carries."""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.vectors import Spatial


@part
def guard_factor(drawn: Spatial, rest: Spatial, F: float) -> float:
    """Return the largest k in [0, 1] with |k l_a + l_0| <= F.

    Where even k = 0 is too much (the weight and the turning alone), the k with the smallest load.

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
