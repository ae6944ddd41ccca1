"""Whole-arm cases for the physics tests: the suite's arm, any grasp, gravity in any direction of the pads' frame."""

from __future__ import annotations

import functools

import numpy as np

from slip_core.params import build
from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams
from test.unit.bridge.one_arm import OneArm

G0 = 9.81
MU_S, MU_K, STRIBECK_VELOCITY, VISCOUS, RHO = 0.5, 0.4, 0.05, 0.05, 0.03
POSTURE = (-0.472, 0.038, -0.522, -2.365, -1.114, 1.205, 0.907)  # well inside all joint limits; pads' normal up
SCALE = np.array([1.0, 1.0, RHO])


@functools.cache
def pad_rotation():
    """Rotation (3, 3) from {ee} to {w} at POSTURE."""
    at_rest = OneArm(build(BridgeParams, {"initial_position": POSTURE}, "test"), urdf_text())
    return at_rest.observe().truth.rotation  # o_R_p is the identity by default


def grasp(
    *, gravity_on_pad=(0.0, 0.0, -1.0), offset=(0.0, 0.0, 0.0), grip=50.0, model="stribeck", plant="rigid", **more
):
    """A simulation held at POSTURE; gravity_on_pad is a direction on {ee} axes, offset o_x_p [m], grip [N]."""
    direction = np.array(gravity_on_pad) / max(np.linalg.norm(gravity_on_pad), 1e-12)
    values = {
        "initial_position": POSTURE,
        "gravity": tuple(G0 * pad_rotation() @ direction),
        "contacts.position": offset,
        "grip.force": grip,
        "friction.model": model,
        "friction.mu_s": MU_S,
        "friction.mu_k": MU_K,
        "friction.stribeck_velocity": STRIBECK_VELOCITY,
        "friction.viscous": VISCOUS,
        "friction.torsional_radius": RHO,
    }
    return OneArm(build(BridgeParams, values | more, "test"), urdf_text(), plant)


def planar(six):
    """The slipping part (x, y, rz) of a 6-vector on pad axes."""
    return six[[0, 1, 5]]


def friction_used(simulation):
    """|S^-1 f| of the wrench on the pad [N]: what the limit mu N has to cover."""
    return float(np.linalg.norm(planar(simulation.observe().wrench.wrench) / SCALE))


def slip_speed(simulation):
    """|S v_s| [m/s]."""
    return float(np.linalg.norm(planar(simulation.observe().slip.twist) * SCALE))


def slip(simulation):
    """S times the slip displacement (x, y, rz); (3,) [m]."""
    return planar(simulation.observe().truth.slip_displacement) * SCALE


def shaken_hold(simulation, k, amplitude, joint=3, hertz=30.0):
    """Effort that holds the arm at its posture and shakes one joint; (7,) [N m]."""
    period = simulation.params.control_period_s
    effort = simulation.holding_effort(np.array(POSTURE), 400.0, 40.0)
    effort[joint] += amplitude * np.sin(2 * np.pi * hertz * k * period)
    return effort
