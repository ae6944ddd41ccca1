"""Drawn worlds that nothing was tuned for: from a set's seed and a number, the same whatever else is drawn.

A world is a scenario, a motion, a sensor, drives, and a simulated world that differs from the controller's
configuration in all its parts at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import matrix_from_quat_xyzw
from slip_core.types import PadMotion
from slip_sim_bridge.params import BridgeParams
from slip_vic.experiments.world import World
from slip_vic.presets import preset_names
from slip_vic.retime.certificate import pad_wrench
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Scenario, cut_or_extend, load

SPREAD: Final = 0.4
"""Largest relative error of mass and friction as configured."""
BIAS_FORCE: Final = 0.1
NOISE_FORCE: Final = 0.05
KINDS: Final = ("scenario", "waypoints", "circle", "lemniscate")
QUINTIC_PEAK: Final = 5.7735
"""Largest acceleration of a quintic from rest to rest over way / duration^2."""
SLOWER, SETTLES_S = 3.0, 5.0
"""How many times the time of its path a world lasts, and for how long an arm with friction then comes to its goal
[s]."""
ARMS: Final = ("ideal", "torque_joint", "motor_current")
MOTION_ARMS: Final = ("velocity_500", "velocity_125", "position_250")
"""Drives that are drawn: those with an effort interface, and those with one for velocities or positions."""
COULOMB: Final = (1.0, 1.0, 0.8, 0.8, 0.4, 0.4, 0.3)
"""Friction of an arm without compensation, joints 1 to 7; further ones have the last [N m]."""
BANDWIDTH: Final = 0.3
"""Largest relative error of the configured bandwidth of a drive with a loop of its own."""
BASE_RAD, BASE_M, LATE_S = 0.3 * np.pi / 180.0, 0.002, 0.01
WEAKEST, MASS = 0.87, 0.1
FASTEST_S, SLOWEST_S = 1.2, 2.0
"""Of several arms: error of the last base, lateness of its reference, its friction over that of the first, error of the
mass, time of the motion."""


def drawn_worlds(
    count: int, seed: int, scenarios: Sequence[str] = (), drive: str = "", assignments: Iterable[str] = ()
) -> Iterator[World]:
    """Yield those of `count` drawn worlds in which static friction carries the object's weight at rest.

    Args:
        count, seed: of the set.
        scenarios: which take turns; none: one with one arm is drawn.
        drive: of all worlds; none: it is drawn, in half of the worlds one of MOTION_ARMS.
        assignments: further ones.
    """
    for number in range(count):
        rng = np.random.default_rng((seed, number))
        scenario = scenarios[number % len(scenarios)] if scenarios else str(rng.choice(scenario_names(1)))
        sensor, noise = str(rng.choice(preset_names("sensors"))), int(rng.integers(2**31))
        drawn = str(rng.choice((*ARMS, *MOTION_ARMS)))
        own_drive = drive or drawn
        known = load(scenario, sensor=sensor, drive=own_drive)
        kind = str(rng.choice(KINDS)) if not known.several else KINDS[0]
        settings = _several(known, rng) if known.several else [*motion(kind, known, rng), *_object(known, rng)]
        for arm, bridge in known.bridges.items():
            settings += [f"{arm}.{one}" if arm else one for one in (*_sensors(rng), *_joints(own_drive, bridge, rng))]
        settings += assignments
        of_world = load(scenario, drive=own_drive, set=settings)
        if known.several or carries_weight(of_world.bridge):
            lasts = SLOWER * next(iter(of_world.controllers.values())).trajectory.duration_s + SETTLES_S
            settings.append(f"bridge.duration_s={lasts}")
            arms, name = len(known.controllers), f"drawn {seed}"
            yield World(scenario, sensor, noise, (*settings,), name, number, arms, motion=kind, drive=own_drive)


def _several(known: Scenario, rng: np.random.Generator) -> list[str]:
    """Return how several arms differ from what their controllers are configured with.

    Base of the last arm within 0.3 deg about every axis and 2 mm, its reference up to 10 ms late, friction of its pad
    0.87 to 1 of the others', mass within 10 %, motion in 1.2 to 2 s.
    """
    (last, own), thing = list(known.bridges.items())[-1], known.first.object
    turned = Rotation.from_rotvec(rng.uniform(-BASE_RAD, BASE_RAD, 3)) * Rotation.from_rotvec(own.base.rotation)
    position = np.array(own.base.position) + rng.uniform(-BASE_M, BASE_M, 3)
    late_s, friction, mass = rng.uniform(0.0, LATE_S), rng.uniform(WEAKEST, 1.0), rng.uniform(1.0 - MASS, 1.0 + MASS)
    return [
        f"{last}.bridge.base.rotation={turned.as_rotvec().tolist()}",
        f"{last}.bridge.base.position={position.tolist()}",
        f"{last}.controller.trajectory.start_s={known.controllers[last].trajectory.start_s + late_s}",
        f"{last}.bridge.friction.mu_s={own.friction.mu_s * friction}",
        f"{last}.bridge.friction.mu_k={own.friction.mu_k * friction}",
        f"bridge.object.mass={thing.mass * mass}",
        f"bridge.object.inertia={(np.array(thing.inertia) * mass).tolist()}",
        f"controller.trajectory.duration_s={rng.uniform(FASTEST_S, SLOWEST_S)}",
    ]


def _object(known: Scenario, rng: np.random.Generator) -> list[str]:
    """Return mass and friction within SPREAD, one of three friction laws, and friction that falls on the way."""
    bridge, (mass, friction) = known.bridge, rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, 2)
    found = [
        f"bridge.object.mass={bridge.object.mass * mass}",
        f"bridge.friction.mu_s={bridge.friction.mu_s * friction}",
        f"bridge.friction.mu_k={bridge.friction.mu_k * friction}",
        f"bridge.friction.model={rng.choice(('stribeck', 'coulomb', 'lugre'))}",
    ]
    if rng.random() < 0.5:
        falls_at = rng.uniform(0.2, 1.0) * known.controller.trajectory.duration_s
        found += [f"bridge.friction.falls_at_s={falls_at}", f"bridge.friction.falls_to={rng.uniform(0.7, 1.0)}"]
    return found


def _sensors(rng: np.random.Generator) -> list[str]:
    """Return biased sensors: force to BIAS_FORCE, slip to 10 mm/s; noise, slip gain, outliers 2 %, dropouts to 30 %."""
    force, slip = rng.normal(size=3), rng.normal(size=2)
    force *= rng.uniform(0.0, BIAS_FORCE) / math.hypot(*force)
    slip *= rng.uniform(0.0, 0.01) / math.hypot(*slip)
    return [
        f"bridge.sensors.wrench.bias={[*force.tolist(), 0.0, 0.0, 0.0]}",
        f"bridge.sensors.wrench.noise_force={NOISE_FORCE}",
        f"bridge.sensors.slip.faults.gain={rng.uniform(0.7, 1.1)}",
        f"bridge.sensors.slip.faults.bias={[*slip.tolist(), 0.0, 0.0, 0.0, 0.0]}",
        "bridge.sensors.slip.faults.outlier_probability=0.02",
        f"bridge.sensors.slip.faults.dropout_probability={rng.uniform(0.0, 0.3)}",
    ]


def _joints(drive: str, known: BridgeParams, rng: np.random.Generator) -> list[str]:
    """Return joints that differ from their drive's preset; commands take effect 0 to 4 ms later.

    Of measured torque: offset to 0.2 N m, friction to 0.3 of COULOMB, velocity noise to 0.01 rad/s. Of drives with a
    loop of their own: bandwidth within BANDWIDTH of what is configured, velocity noise to 0.01 rad/s.
    """
    joints, late_s = len(known.joint_names), float(rng.integers(0, 5)) * 1e-3
    noise, offset, share = rng.uniform(0.0, 0.01), rng.uniform(-0.2, 0.2, joints), rng.uniform(0.0, 0.3)
    if known.drive.interface != "effort":
        return [
            f"bridge.drive.bandwidth={known.drive.bandwidth * rng.uniform(1.0 - BANDWIDTH, 1.0 + BANDWIDTH)}",
            f"bridge.drive.delay_s={known.drive.delay_s + late_s}",
            f"bridge.sensors.joint.noise_velocity={noise}",
        ]
    if drive == "motor_current":
        return [f"bridge.drive.delay_s={max(late_s, 0.002)}"]
    return [
        f"bridge.sensors.joint.noise_velocity={noise}",
        f"bridge.drive.offset={offset.tolist()}",
        f"bridge.drive.coulomb={(share * np.array(cut_or_extend(list(COULOMB), joints))).tolist()}",
        f"bridge.drive.delay_s={late_s}",
        "controller.tare.duration_s=0.3",
    ]


def motion(kind: str, known: Scenario, rng: np.random.Generator) -> list[str]:
    """Return the trajectory parameters of a kind, in the plane of the scenario's own motion, at most as fast.

    Curves turn with 0.4 to 1 of the largest acceleration of the scenario's own motion.
    """
    own = known.controller.trajectory
    way, turn = np.array(own.displacement), np.array(own.rotation)
    if kind == "waypoints":
        shares = np.array([1.0, 2.0]) / 3.0 + rng.uniform(-0.08, 0.08, 2)
        bend = 0.08 * math.hypot(*way) * rng.uniform(-1.0, 1.0, 2)
        across = np.cross(turn / math.hypot(*turn), way / math.hypot(*way))
        points = [np.concatenate((k * way + b * across, k * turn)) for k, b in zip(shares, bend, strict=True)]
        flat = np.concatenate([*points, way, turn]).tolist()
        return ["controller.trajectory.kind=waypoints", f"controller.trajectory.waypoints={flat}"]
    if kind in ("circle", "lemniscate"):
        plane = {0: "yz", 1: "zx", 2: "xy"}[int(np.argmax(np.abs(turn)))]
        radius = 0.08
        fastest = QUINTIC_PEAK * math.hypot(*way) / own.duration_s**2
        period = 2.0 * math.pi * math.sqrt(radius / (fastest * rng.uniform(0.4, 1.0)))
        return [
            f"controller.trajectory.kind={kind}", f"controller.trajectory.plane={plane}",
            f"controller.trajectory.radius={radius}", f"controller.trajectory.period_s={period:.4f}",
            f"controller.trajectory.ramp_s={0.5 * period:.4f}", f"controller.trajectory.duration_s={2.0 * period:.4f}",
            f"controller.trajectory.rotation={(0.5 * turn).tolist()}",
        ]  # fmt: skip
    return []


def carries_weight(bridge: BridgeParams) -> bool:
    """Return whether static friction, the least on the way, carries the object's weight in the attitude of the grasp.

    The object's axes start along those of the world, as in all shipped scenarios.
    """
    of, R = bridge.friction, matrix_from_quat_xyzw(bridge.contacts.orientation_xyzw[:4])
    force, torque = np.split(pad_wrench(bridge, PadMotion(np.zeros(3), R, np.zeros(6), np.zeros(6))), 2)
    load = math.hypot(*(R.T @ force)[:2], (R.T @ torque)[2] / of.torsional_radius)
    left = of.falls_to if of.falls_at_s > 0.0 else 1.0
    return load < left * (of.mu_k if of.model == "coulomb" else of.mu_s) * bridge.grip.force
