"""Scenes for the simulation tests: the paper's grasp and others, disturbed by seeded efforts so that it slips."""

from __future__ import annotations

import mujoco
import numpy as np
import yaml

from slip_core.params import build
from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams
from slip_vic.presets import preset_text
from test.unit.bridge.one_arm import OneArm


def scenario_params(name: str = "paper_planar", **values) -> BridgeParams:
    """The bridge's parameters of a scenario on endless pads; keyword `a__b` overrides parameter `a.b`."""
    content = yaml.safe_load(preset_text("scenarios", name))
    flat = {**_flat(content["shared"]), **_flat(content["bridge"]), "grip.pad_size": (10.0, 10.0)}
    return build(BridgeParams, flat | {key.replace("__", "."): value for key, value in values.items()}, "test")


def scene(name: str = "paper_planar", plant: str = "rigid", **values) -> OneArm:
    """A simulation of a scenario."""
    return OneArm(scenario_params(name, **values), urdf_text(), plant)


class Shaker:
    """Smooth random joint efforts around the holding effort: seeded sines of 0.5 to 4 Hz per joint."""

    def __init__(self, simulation: OneArm, seed: int, acceleration: float = 12.0) -> None:
        rng = np.random.default_rng(seed)
        self.simulation, self.acceleration = simulation, acceleration
        self.hertz, self.phase = rng.uniform(0.5, 4.0, 7), rng.uniform(0.0, 2.0 * np.pi, 7)
        self.start = simulation.observe().joint.position
        self.start_ns = simulation.stamp_ns

    def effort(self):
        """Joint effort of this tick: pulled to the start, and shaken by +-acceleration [rad/s2] times the inertia."""
        time = (self.simulation.stamp_ns - self.start_ns) * 1e-9
        wave = self.acceleration * np.sin(2.0 * np.pi * self.hertz * time + self.phase)
        return self.simulation.holding_effort(self.start + wave / 20.0, 20.0, 2.0)

    def run(self, ticks: int):
        """Advance and yield after every tick."""
        for _ in range(ticks):
            self.simulation.step(self.effort())
            yield


def _flat(values, prefix=""):
    out = {}
    for key, value in values.items():
        out.update(_flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value})
    return out


AT_THE_STOP = (-0.47, 0.04, -0.52, -0.2, -1.11, 1.2, 0.9)


def driven_into_the_stop(grip, ticks=300, on_solved=None, **values):
    """Drive joint 4 into its stop, which shakes hand and object hard; yield after every tick at the stop.

    on_solved: called with the change of friction that one more pass over stops and friction makes [N, N m], and with
    the friction, for every solution at the stop.
    """
    simulation = scene(initial_position=AT_THE_STOP, grip__force=grip, **values)
    plant = simulation.plant
    agree, slip_tau = plant._agree, plant.data.qfrc_applied[7:]

    def watched(effort, normal_force, substeps):
        substeps = agree(effort, normal_force, substeps)
        before, after_state = slip_tau.copy(), plant._next_state.copy()
        for mujoco_pass in (mujoco.mj_fwdActuation, mujoco.mj_fwdAcceleration, mujoco.mj_fwdConstraint):
            mujoco_pass(plant.model, plant.data)
        plant._solve(effort, normal_force, substeps, plant.data.qfrc_constraint, 0)
        on_solved(float(np.abs(slip_tau - before).max()), before)
        slip_tau[:], plant._next_state[:] = before, after_state
        return substeps

    if on_solved is not None:
        plant._agree = watched
    effort = simulation.observe().joint.effort.copy()
    effort[3] += 30.0
    for _ in range(ticks):
        simulation.step(effort)
        if plant.data.nefc:
            yield simulation
    assert simulation.observe().joint.position[3] < 0.0
