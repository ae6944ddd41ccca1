"""What every cycle does around the law: walls and the last gate, and a look at what the law saw.

Plain forms: `repulsion`, `output_gate`, `load_monitor`, `path_time`.

walls       rows of near_lower, near_upper, brake_from, velocity, trip, effort (n each); see `repulsion.Walls`
speeds      margin [rad], linear [m/s] and angular [rad/s] speed limit of the pad
watching    down (3), fall memory [s], error bounds [m], [rad], slip speed that counts as slip [m/s], slip axes (3)
watched     fall [m/s], path speed, whether the reference moves, shown slip [m/s], velocity of evidence (3), twist (6),
            1 where there is evidence
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, REAL, VOID, kernel, part
from slip_core.small_kernel import LARGEST
from slip_core.vector_kernel import Matrix, Three, add, dot, minus, nine, norm, put, three, times, turn, turn_back
from slip_vic_controller.core.arm_kernel import BIAS, TWIST

WATCHED = 14
BRAKED_FROM = 0.75
"""Part of the pad's speed limits from which it is braked."""
BRAKE_LINEAR, BRAKE_ANGULAR = 100.0, 10.0
"""[N s/m], [N m s/rad]."""
EVIDENCE_MEMORY_S = 0.1
MOVING = 0.01
"""[m/s] or [rad/s] above which a reference asks for motion."""


@part
def _repulsion(q: float, qd: float, walls: Array, margin: float) -> float:
    speed = abs(qd)
    if not (q < walls[0] or q > walls[1] or speed > walls[2]):
        return 0.0
    low = min(max((walls[0] - q) / margin, 0.0), 1.0)
    high = min(max((q - walls[1]) / margin, 0.0), 1.0)
    brake = min(max((speed - walls[2]) / (walls[3] - walls[2]), 0.0), 1.0)
    sign = 1.0 if qd > 0.0 else -1.0 if qd < 0.0 else 0.0
    return walls[5] * (low * low - high * high - sign * brake)


@part
def _brake(v: Three, limit: float, damping: float) -> Three:
    speed = norm(v)
    if not speed > BRAKED_FROM * limit:
        return 0.0, 0.0, 0.0
    return times(-damping * (1.0 - BRAKED_FROM * limit / speed), v)


@part
def _in_plane(R: Matrix, axes: Three, v: Three) -> Three:
    a = turn_back(R, v)
    return turn(R, (axes[0] * a[0], axes[1] * a[1], axes[2] * a[2]))


@kernel(VOID(IN1, IN1, IN1, INT, IN1, IN2, IN1, IN1, REAL, OUT1))
def guard(
    q: Array, qd: Array, arm: Array, braked: int, wanted: Array, walls: Array, speeds: Array, before: Array,
    step: float, out: Array,
) -> None:  # fmt: skip
    """Add the walls to the wanted torque and pass the gate.

    Args:
        q, qd: joint state; (n,).
        arm: record of the arm, looked at where `braked` is not 0.
        braked: whether the pad's speed is limited in this cycle.
        wanted: (n,) [N m].
        walls, speeds: see the module.
        before: the last effort; (n,) [N m].
        step: most that it may change [N m].
        out: effort (n), clipped or limited 0 or 1 (n), limited 0 or 1 (n), refused 0 or 1, number of ones (2).

    Implements: ours: `joint_repulsion`, `pad_brake`, `pass_gate`.
    """
    n = q.shape[0]
    linear, angular = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if braked != 0:
        linear = _brake(three(arm, TWIST), speeds[1], BRAKE_LINEAR)
        angular = _brake(three(arm, TWIST + 3), speeds[2], BRAKE_ANGULAR)
    pushed = dot(linear, linear) + dot(angular, angular) != 0.0
    finite = True
    for j in range(n):
        torque = wanted[j] + _repulsion(q[j], qd[j], walls[:, j], speeds[0])
        if pushed:
            for i in range(3):
                torque += arm[BIAS + n + i * n + j] * linear[i] + arm[BIAS + n + (3 + i) * n + j] * angular[i]
        out[j] = torque
        finite = finite and abs(torque) <= LARGEST
    clipped = limited = 0.0
    for j in range(n):
        limit = walls[5, j]
        torque = out[j] if finite else before[j]
        inside = min(max(torque, -limit), limit)
        effort = min(max(inside, before[j] - step), before[j] + step)
        # Where the rate does not bind this is `inside` to the last bit. Rounding may not carry it over the limit.
        effort = min(max(effort, -limit), limit)
        out[2 * n + j] = 1.0 if effort != inside else 0.0
        out[n + j] = 1.0 if effort != inside or inside != torque else 0.0
        out[j] = effort
        clipped += out[n + j]
        limited += out[2 * n + j]
    out[3 * n], out[3 * n + 1], out[3 * n + 2] = (0.0 if finite else 1.0), clipped, limited


@kernel(INT(IN1, IN2, IN1, IN1, REAL))
def too_fast_index(qd: Array, walls: Array, speeds: Array, watched: Array, trip: float) -> int:
    """Return which speed is beyond what braking should have allowed: a joint, n = linear, n + 1 = angular, -1 = none.

    Args:
        qd: (n,) [rad/s].
        walls, speeds: see the module.
        watched: of the last cycle; its twist is the pad's.
        trip: factor on the pad's speed limits.

    Implements: ours: `too_fast`.
    """
    n, fastest = qd.shape[0], -1
    for j in range(n):
        if abs(qd[j]) > walls[4, j]:
            return j
    if norm(three(watched, 10)) > trip * speeds[2]:
        fastest = n + 1
    return n if norm(three(watched, 7)) > trip * speeds[1] else fastest


@kernel(VOID(IN1, IN1, IN1, IN1, IN1, REAL, OUT1))
def watch(arm: Array, outcome: Array, reference: Array, watching: Array, before: Array, dt: float, out: Array) -> None:
    """Look at what the law saw: errors, fall, and whether slip and wrench agree.

    Args:
        arm: record of the arm.
        outcome: of the law.
        reference: packed.
        watching: see the module.
        before: watched one cycle earlier.
        dt: since then [s].
        out: watched; see the module.

    Implements: ours: `scale_for_error`, `fall_speed`, `slip_evidence`, `moving`.
    """
    worst = max(outcome[4] / watching[4], outcome[5] / watching[5])
    slipping = 1.0 if outcome[6] > watching[6] else outcome[3]
    R, axes = nine(arm, 3), three(watching, 7)
    beyond = minus(three(outcome, 7), three(reference, 18))
    gain = dot(_in_plane(R, axes, three(watching, 0)), beyond)
    out[0] = max(0.0, before[0] * math.exp(-dt / watching[3]) + slipping * gain * dt)
    out[1] = 1.0 if worst <= 0.5 else max(0.0, 2.0 - 2.0 * worst)
    out[2] = (
        1.0
        if dot(three(reference, 12), three(reference, 12)) + dot(three(reference, 15), three(reference, 15))
        > MOVING * MOVING
        else 0.0
    )
    velocity = (0.0, 0.0, 0.0)
    if before[13] > 0.0 and dt > 0.0:
        change = minus(minus(three(arm, TWIST), three(before, 7)), times(dt, three(outcome, 10)))
        faded = times(math.exp(-dt / EVIDENCE_MEMORY_S), three(before, 4))
        velocity = add(faded, _in_plane(R, axes, change))
    out[3] = norm(velocity)
    put(out, 4, velocity)
    for i in range(6):
        out[7 + i] = arm[TWIST + i]
    out[13] = 1.0
