"""The friction of a step on the object's relative joints, in plain form: what `grasp_kernel.friction_step` computes.

The contact twist is v = J [sx', sy', rz'] at the pad centre (object relative to pad), with
J = [[1, 0, y], [0, 1, -x], [0, 0, 1]].
"""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.vector_kernel import Three
from slip_sim_bridge.sim.friction import FrictionLaw, solve_contact, substeps_needed


def slip_joint_friction(
    solved: Array,
    slip_q: Array,
    slip_qd: Array,
    normal_force: float,
    period: float,
    substeps: int,
    law: FrictionLaw,
    state: Three,
    rho: float,
) -> tuple[Array, Three, int]:
    """Return J^T f of the coming sub-step on the relative joints (3,) [N, N m], the law's next state, and sub-steps.

    Args:
        solved: relative part of M^-1 times a unit force on each relative joint, and times all forces but friction;
            (4, 3).
        slip_q, slip_qd: relative joints; (3,) [m, rad], [m/s, rad/s].
        normal_force: [N].
        period: control period [s].
        substeps: into how many steps the period is split; 0 chooses what the law needs.
        law: friction law.
        state: of the law; (3,) [m].
        rho: torsional radius [m].

    Implements: ours: v = v_free + dt J M^-1 J^T f, solved by `solve_contact`.
    """
    x, y, _ = slip_q.tolist()
    J = np.array([[1.0, 0.0, y], [0.0, 1.0, -x], [0.0, 0.0, 1.0]])
    mobility = J @ solved[:3] @ J.T
    substeps = substeps or substeps_needed(period * mobility, normal_force, law, rho)
    dt = period / substeps
    v_free = J @ (slip_qd + dt * solved[3])
    contact = solve_contact(v_free, dt * mobility, normal_force, dt, law, state, rho)
    return J.T @ contact.force, contact.state, substeps
