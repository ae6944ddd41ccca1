"""Slip velocity from a sensor that reports where the pad is on the object: the motion between two of its samples."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.compiled import IN1, IN2, OUT1, REAL, VOID, kernel
from slip_core.types import DisplacementSample, SlipSample
from slip_core.vectors import Spatial, mat, put_spatial, vec
from slip_vic_controller.law.rotation import exponential, logarithm


@kernel(VOID(IN1, IN2, IN1, IN2, REAL, OUT1))
def mean_velocity(s_1: Array, R_1: Array, s_2: Array, R_2: Array, dt: float, twist: Array) -> None:
    """Write the mean slip velocity between two displacements; (3,) [m], (3, 3) on {p} axes; dt [s]; (6,) {ee}.

    On the axes of the pad half way, so of second order in dt.

    Implements: Eq. (12), (13), solved for v_s: s_l_dot = R_s v_sl, R_s_dot = R_s S(v_sa).
    """
    turn = logarithm(mat(R_1).T() @ mat(R_2))
    R_half = mat(R_1) @ exponential(0.5 * turn)
    put_spatial(twist, (1.0 / dt) * Spatial(R_half.T() @ (vec(s_2) - vec(s_1)), turn))


class SlipFromDisplacement:
    """Makes slip velocities of one contact from its displacements; what comes first, or after a gap, makes none.

    A velocity has the stamp half way between the two displacements: it is the mean of that time.
    """

    def __init__(self) -> None:
        self._last: tuple[int, Array, Array] | None = None

    def __call__(self, sample: DisplacementSample) -> SlipSample | None:
        """Return the slip velocity since the displacement before; an invalid one makes an invalid velocity."""
        if not sample.valid:
            self._last = None
            return SlipSample(sample.stamp_ns, np.full(6, np.nan), valid=False)
        place, turned = np.array(sample.pose[:3]), matrix_from_quat_xyzw(sample.pose[3:])
        before, self._last = self._last, (sample.stamp_ns, place, turned)
        if before is None or sample.stamp_ns <= before[0]:
            return None
        twist = np.empty(6)
        mean_velocity(before[1], before[2], place, turned, (sample.stamp_ns - before[0]) * 1e-9, twist)
        return SlipSample((before[0] + sample.stamp_ns) // 2, twist)
