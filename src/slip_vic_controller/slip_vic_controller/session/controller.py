"""What is configured: parameters, arms and the CONFIG of the cycle, for each arm and for all that hold one object."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from slip_core.arms import shared
from slip_core.arrays import Array
from slip_core.records import Records, place, record, records
from slip_core.types import JointCommand
from slip_vic_controller.config.controller import make_config
from slip_vic_controller.config.observer import capacity
from slip_vic_controller.contact.layouts import ROW_SIZE
from slip_vic_controller.law.gains import RAMP, gain_report, make_ramp
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.conditions import Missing, Reason, forget_conditions
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, OUTPUTS, TASK_SIZE, TASK_STATE, ArmState

_COMMAND = place(OUTPUTS, "command")


class ArmController:
    """The configuration of one arm: parameters, arm, and the CONFIG of the cycle.

    Args:
        params: checked parameters.
        urdf_text: the arm; gives kinematics, dynamics and limits.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.
        arms: how many hold the object.

    Raises:
        InputError: the parameters and the URDF do not fit.
    """

    def __init__(self, params: ControllerParams, urdf_text: str, *, lockstep: bool, arms: int = 1) -> None:
        self.params, self.lockstep = params, lockstep
        armature = params.drive.of_joints("armature", len(params.joint_names))
        self.robot = Robot(urdf_text, params.ee_frame, params.joint_names, params.gravity, armature)
        self.config = make_config(params, self.robot, lockstep=lockstep, arms=arms)
        self.gains = gain_report(params).gains
        self.contacts = params.contacts.count
        self.make_command = partial(JointCommand, interface=params.command.interface)
        self.command_place = slice(_COMMAND.start, _COMMAND.start + len(params.joint_names))
        self.external = params.trajectory.kind in ("topic", "goal")
        self.rows = capacity(params) if params.slip_estimator == "observer" else 0


class Controller:
    """The configuration of all arms that hold an object. Sessions may share it.

    Args:
        params: checked parameters of each arm by its name; the first arm leads along the path.
        urdfs: the arms.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.

    Raises:
        InputError: parameters and URDFs do not fit, or the arms do not fit each other.
    """

    def __init__(self, params: Mapping[str, ControllerParams], urdfs: Mapping[str, str], *, lockstep: bool) -> None:
        shared(params, COMMON, "all arms hold one object")
        self.lockstep = lockstep
        self.arms = {
            name: ArmController(of, urdfs[name], lockstep=lockstep, arms=len(params)) for name, of in params.items()
        }
        self.first = next(iter(self.arms.values()))
        self.rows = max(arm.rows for arm in self.arms.values())
        self.config = np.concatenate([arm.config for arm in self.arms.values()])
        self.config.setflags(write=False)

    def new_state(self) -> Array:
        """Return the state before the first cycle: TASK_STATE, ARM_STATE of each arm, histories of their observers."""
        n = len(self.arms)
        state = np.zeros(TASK_SIZE + n * (ARM_SIZE + self.rows * ROW_SIZE))
        record(state[:TASK_SIZE], TASK_STATE).path.scale = 1.0
        rows: Records[ArmState] = records(state[TASK_SIZE : TASK_SIZE + n * ARM_SIZE], ARM_STATE)
        for row, arm in zip(rows, self.arms.values(), strict=True):
            row.mode.enabled, row.mode.good_since_ns = record(arm.config, CONFIG).conditions.auto_enable, NEVER
            row.mode.reason.reason, row.mode.reason.which = Reason.WAITS, Missing.JOINT_STATES
            forget_conditions(row.conditions)
            for slip in row.law.slips:
                slip.rotation[:] = np.eye(3)
            row.sliding_ns = -1  # what slides in the very first sample is believed
            row.tare.begun_ns = row.tare.wrench_ns = NEVER
            row.observed.path_speed, row.tuned = 1.0, make_ramp(arm.gains, arm.gains, 0, 0.0).view(RAMP)[0]
            row.grip.command = row.grip.actual = max(arm.params.grip.nominal_force, arm.params.grip.least_force)
        return state


COMMON = ("mode", "control_period_s", "trajectory.kind", "governor.mode")
"""Parameters that are equal for all arms that hold one object."""
