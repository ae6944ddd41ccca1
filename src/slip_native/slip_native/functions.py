"""The functions of the library: the kernels of the control cycle behind pointers, as C calls them.

Each becomes a C function of its name; annotations give the types, docstrings the comments of the header. Arguments
that are pointers are buffers of records: `config` and `arm` are ControllerConfig and ArmState of one arm.
"""

from __future__ import annotations

from numba import carray

from slip_core.arrays import Array
from slip_core.records import POSE, record
from slip_vic_controller.config.noise import use_tare
from slip_vic_controller.contact.observer import ROW_SIZE
from slip_vic_controller.cycle.cycle import cycle
from slip_vic_controller.interfaces import mean_velocity
from slip_vic_controller.law.arm import ARM, gather
from slip_vic_controller.law.bounds import stiffness_limit
from slip_vic_controller.law.gains import LAW_GAINS, adapt, slow_down
from slip_vic_controller.law.symbols import SYMBOLS
from slip_vic_controller.safety.hold import fill_hold
from slip_vic_controller.session.arrival import (
    WHY,
    begin_answer,
    is_silent,
    overload,
    ramp_to,
    receive_joint_state,
    receive_slip,
    receive_wrench,
)
from slip_vic_controller.session.symbols import fill_symbols
from slip_vic_controller.state import ARM_SIZE, CONFIG, CONFIG_SIZE, INPUTS_SIZE, OUTPUTS_SIZE, TASK_SIZE

In = Array
"""Numbers that a function reads."""
Out = Array
"""Numbers that it reads and writes."""
_ARM, _GAINS, _POSE, _SYMBOLS, _WHY = (dtype.itemsize // 8 for dtype in (ARM, LAW_GAINS, POSE, SYMBOLS, WHY))


def slip_vic_receive_joint_state(
    config: In, arm: Out, joints: int, stamp_ns: int, q: In, qd: In, effort: In, refused: int, now_ns: int,
    lockstep: int,
) -> int:  # fmt: skip
    """Take in a joint state; return its SlipVic_Reason, 0 where it is good.

    q, qd, effort: of `joints` joints [rad, rad/s, N m]; refused: whether the message is broken; now_ns: of arrival.
    """
    c, s = carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE)
    q_, qd_, effort_ = carray(q, joints), carray(qd, joints), carray(effort, joints)
    return receive_joint_state(c, s, stamp_ns, q_, qd_, effort_, refused != 0, now_ns, lockstep != 0)


def slip_vic_receive_wrench(
    config: In, arm: Out, contact: int, stamp_ns: int, wrench: In, refused: int, now_ns: int
) -> int:
    """Take in the wrench of a contact, 6 numbers [N, N m]; return its SlipVic_Reason, 0 where it is good."""
    c, s = carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE)
    return receive_wrench(c, s, contact, stamp_ns, carray(wrench, 6), refused != 0, now_ns)


def slip_vic_receive_slip(
    config: In, arm: Out, contact: int, stamp_ns: int, twist: In, valid: int, refused: int, now_ns: int
) -> int:
    """Take in the slip velocity of a contact, 6 numbers [m/s, rad/s]; return its SlipVic_Reason, 0 where it is good."""
    c, s = carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE)
    return receive_slip(c, s, contact, stamp_ns, carray(twist, 6), valid != 0, refused != 0, now_ns)


def slip_vic_mean_velocity(s_1: In, R_1: In, s_2: In, R_2: In, dt_ns: int, twist: Out) -> None:
    """Write the mean slip velocity between two slip displacements, 6 numbers [m/s, rad/s]; rotations by rows."""
    first, second = (carray(s_1, 3), carray(R_1, (3, 3))), (carray(s_2, 3), carray(R_2, (3, 3)))
    mean_velocity(first[0], first[1], second[0], second[1], dt_ns * 1e-9, carray(twist, 6))


def slip_vic_is_silent(config: In, arm: Out, now_ns: int) -> int:
    """Return 1 where no good joint state has come for the age limit."""
    return 1 if is_silent(carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE), now_ns) else 0


def slip_vic_ramp_to(arm: Out, target: In, least_ns: int) -> None:
    """Ramp gains and payload to a SlipVic_LawGains from the next cycle on, in least_ns or longer for stability."""
    ramp_to(carray(arm, ARM_SIZE), carray(target, _GAINS), least_ns)


def slip_vic_retune(config: Out, classical: int, spin_excursion: float, hold_stiffness: float) -> None:
    """Turn the gains that a user sets, in `config->gains`, into those of the law, and let HOLD use their object.

    classical: whether the controller is; spin_excursion: infinite where gains.spin is not bounded [rad].
    """
    c = record(carray(config, CONFIG_SIZE), CONFIG)
    adapt(c.gains.gains, classical != 0, spin_excursion, c.law.contact[0].slip_axes, c.k_s_limit)
    slow_down(c.gains.gains, c.fastest_rate)
    of = c.gains.object
    fill_hold(c.hold, of.mass, of.inertia, of.gravity, hold_stiffness, c.impedance_delay_s)


def slip_vic_too_heavy(config: In, arm: In, inputs: In, why: Out) -> None:
    """Write to a SlipVic_WhyRecord why the arm cannot hold the object where it was in the last cycle, if it cannot."""
    overload(carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE), carray(inputs, INPUTS_SIZE), carray(why, _WHY))


def slip_vic_use_tare(config: Out, arm: In) -> None:
    """Use the noise that a tare has measured, after a cycle in which `arm->tare.rough` or `.done` has changed."""
    use_tare(carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE))


def slip_vic_begin_answer(
    config: In, arm: Out, inputs: Out, now_ns: int, request: int, missing: int, reason: int
) -> int:
    """Begin the CycleInputs of an arm; return 1 where it is known where the arm is.

    Then the position and velocity for which the caller fills `inputs->arm` stand in `arm->joint.answers`. reason: what
    slip_vic_receive_joint_state returned.
    """
    c, s, i = carray(config, CONFIG_SIZE), carray(arm, ARM_SIZE), carray(inputs, INPUTS_SIZE)
    return 1 if begin_answer(c, s, i, now_ns, request, missing, reason) else 0


def slip_vic_gather(
    joints: int, qd: In, placement: In, R_joint: In, p_joint: In, v: In, w: In, a: In, dw: In, J_world: In, nle: In,
    gravity: In, M: In, arm: Out,
) -> None:  # fmt: skip
    """Fill a SlipVic_Arm from Pinocchio's data; matrices by columns, as Eigen has them.

    placement: SlipVic_Pose of {ee} on the last joint; R_joint, p_joint, v, w, a, dw: its pose, velocity and
    acceleration at zero joint acceleration (Pinocchio's oMi, v, a); J_world: its Jacobian in WORLD (6, n); nle,
    gravity: C qd + g and g; M: inertia, upper triangle.
    """
    n = joints
    gather(
        carray(qd, n), carray(placement, _POSE), carray(R_joint, (3, 3)).T, carray(p_joint, 3), carray(v, 3),
        carray(w, 3), carray(a, 3), carray(dw, 3), carray(J_world, (n, 6)).T, carray(nle, n), carray(gravity, n),
        carray(M, (n, n)).T, carray(arm, _ARM),
    )  # fmt: skip


def slip_vic_cycle(config: In, state: Out, exchange: Out, arms: int, rows: int) -> int:
    """Run a control cycle; bit k of the result: arm k has a command in its CycleOutputs.

    config: of every arm; state: TaskState, ArmState of every arm, then `rows` SlipVic_Row of each; exchange:
    CycleInputs of every arm, CycleOutputs of every arm.
    """
    c, s = carray(config, arms * CONFIG_SIZE), carray(state, TASK_SIZE + arms * (ARM_SIZE + rows * ROW_SIZE))
    return cycle(c, s, carray(exchange, arms * (INPUTS_SIZE + OUTPUTS_SIZE)))


def slip_vic_describe(config: In, inputs: In, outputs: In, symbols: Out) -> None:
    """Fill the SlipVic_Symbols of an arm from its last cycle: the published numbers of the law."""
    i, o = carray(inputs, INPUTS_SIZE), carray(outputs, OUTPUTS_SIZE)
    fill_symbols(carray(config, CONFIG_SIZE), i, o, carray(symbols, _SYMBOLS))


def slip_vic_stiffness_limit(damping: float, inertia: float, delay_s: float) -> float:
    """Return the stiffness of an axis above which its impedance oscillates with a delay [N/m, N m/rad]."""
    return stiffness_limit(damping, inertia, delay_s)


FUNCTIONS = (
    slip_vic_receive_joint_state,
    slip_vic_receive_wrench,
    slip_vic_receive_slip,
    slip_vic_mean_velocity,
    slip_vic_is_silent,
    slip_vic_ramp_to,
    slip_vic_retune,
    slip_vic_too_heavy,
    slip_vic_use_tare,
    slip_vic_stiffness_limit,
    slip_vic_begin_answer,
    slip_vic_gather,
    slip_vic_cycle,
    slip_vic_describe,
)
