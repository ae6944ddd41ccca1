"""The wrench on the own pad as the sensor reads it or as the model has it, and the lever at which the load pulls."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, put_spatial, spatial, vec
from slip_vic_controller.interfaces import wrench_at_pad
from slip_vic_controller.law.contact import contact_arm, pad_rotation
from slip_vic_controller.law.internal import mean_arm
from slip_vic_controller.safety.hold import plausible_arm
from slip_vic_controller.safety.modes import follows
from slip_vic_controller.state import ArmCycle, ArmState, ControllerConfig, CycleInputs


@part
def tared_wrench(config: ControllerConfig, state: ArmState, R_ee: Mat) -> Spatial:
    """Return what the tare reads [N, N m] {ee}: the sensor, which nothing else uses by then, or the model's wrench."""
    if config.models_wrench != 0:
        return spatial(state.wrench_of_model[0])
    return wrench_at_pad(config.wrench_sensor, state.wrench_inputs[0].values, R_ee)


@part
def own_wrench(config: ControllerConfig, state: ArmState, R_ee: Mat) -> Spatial:
    """Return the wrench of the object on the own pad [N, N m] {ee}, without the sensor's bias, or that of the model."""
    if state.wrench_modelled != 0:
        return spatial(state.wrench_of_model[0])
    return tared_wrench(config, state, R_ee) - spatial(state.tare.wrench.bias)


@part
def put_own_wrench(config: ControllerConfig, state: ArmState, inputs: CycleInputs, h: Array) -> None:
    """Write the wrench of the object on the own pad (6,) [N, N m] {w}, without the sensor's bias."""
    R_ee = mat(inputs.arm.rotation)
    put_spatial(h, R_ee @ own_wrench(config, state, R_ee))


@part
def arm_of_load(config: ControllerConfig, state: ArmState, pad: Mat) -> Vec:
    """Return r = x_c - x_o at which the load pulls, on the axes of the pad whose attitude is `pad` [m] {ee}."""
    slips, own, positions = state.law.slips, config.law.contact[0], ZERO
    # The levers of several shares of the weight cancel, as far as they can.
    if config.law.contacts < config.hold.carriers:  # where the other pads are is not known
        return ZERO
    if config.law.contacts > 1:
        r = mean_arm(config.law, config.gains, slips)
    else:
        r = contact_arm(pad, vec(own.position), own, slips[0])
    for k in range(config.law.contacts):
        positions = positions + vec(config.law.contact[k].position)
    return plausible_arm(pad.T() @ ((1.0 / config.law.contacts) * positions), r)


@part
def model_wrench(c: ArmCycle) -> None:
    """Let the wrench be that of a held object that moves as the path does, where no sensor measures it.

    Implements: ours: Newton's law for the object at the desired acceleration, f = m (g - a), without its rotation.
    """
    config, state, inputs = c.config, c.state, c.inputs
    law, hold, R = state.law, config.hold, mat(inputs.arm.rotation)
    force = vec(hold.weight)
    if follows(state.mode.mode) and law.known != 0:
        force = force - hold.mass * vec(c.task.desired.acceleration)
    pad = pad_rotation(config.law.contact[0], law.slips[0])
    load, R_o = Spatial(force, -(R @ arm_of_load(config, state, pad)).cross(force)), R @ pad.T()
    state.wrench_modelled = 1
    for k in range(config.law.contacts):
        if inputs.arm.M[0, 0] > 0.0:
            put_spatial(state.wrench_of_model[k], (R_o @ pad_rotation(config.law.contact[k], law.slips[k])).T() @ load)
