"""Drawn worlds that nothing was tuned for: from a set's seed and a number, the same whatever else is drawn.

A world is a scenario, a motion, a sensor, a simulated world that differs from the controller's configuration, and one
trouble of the wrench sensor; or drives, joints and sensors with all troubles at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_sim_bridge.params import BridgeParams
from slip_vic.experiments.world import World, coulomb_of
from slip_vic.presets import preset_names
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Scenario, drive_assignments, load_scenario

SPREAD: Final = 0.3
"""Largest relative error of what the controller is configured with: mass, inertia, friction, centre of mass."""
WRONG: Final = 0.6
"""Share of worlds in which each of them is wrong."""
BIAS_FORCE: Final = 0.1
NOISE_FORCE: Final = 0.05
LATENCY_S: Final = (0.001, 0.005)
KINDS: Final = ("scenario", "waypoints", "circle", "lemniscate")
TROUBLES: Final = ("none", "bias", "noise configured", "noise unconfigured", "latency")
QUINTIC_PEAK: Final = 5.7735
"""Largest acceleration of a quintic from rest to rest over way / duration^2."""
SLOWER, SETTLES_S = 3.0, 5.0
"""How many times the time of its path a world with drives lasts, and for how long an arm with friction then comes to
its goal [s]."""
ARMS: Final = ("ideal", "torque_joint", "motor_current")
MOTION_ARMS: Final = ("velocity_500", "velocity_125", "position_250")
"""Drives that are drawn: those that take efforts, and those that take velocities or positions."""
BANDWIDTH: Final = 0.3
"""Largest relative error of the configured bandwidth of a drive with a loop of its own."""
BASE_RAD, BASE_M, LATE_S = 0.3 * np.pi / 180.0, 0.002, 0.01
WEAKEST, MASS = 0.87, 0.1
FASTEST_S, SLOWEST_S = 1.2, 2.0
"""Of several arms: error of the last base, lateness of its reference, its friction over that of the first, error of the
mass, time of the motion."""


def length(vector: Array) -> float:
    """Return the length of a vector, to the same bits on every processor: numpy's depends on its instruction set."""
    total = 0.0
    for value in vector.tolist():
        total += value * value
    return math.sqrt(total)


def drawn_worlds(
    count: int, seed: int, scenarios: Sequence[str] = (), *, drives: bool, assignments: Iterable[str] = ()
) -> Iterator[World]:
    """Yield those of `count` drawn worlds in which friction carries the weight, with further assignments each."""
    for number in range(count):
        world = draw(number, seed, scenarios, drives=drives)
        if world is not None:
            yield replace(world, settings=(*world.settings, *assignments))


def draw(number: int, seed: int, scenarios: Sequence[str] = (), *, drives: bool = True) -> World | None:
    """Return world `number` of a seed; None where static friction would not carry the object's weight at rest.

    Args:
        number: from 0 on.
        seed: of the set.
        scenarios: which take turns; none: one with one arm is drawn.
        drives: whether drives, joints and sensors are drawn with all troubles at once; a world then lasts as long as a
            law that takes its time needs.
    """
    name = f"drawn {seed}"
    scenario = scenarios[number % len(scenarios)] if scenarios else ""
    arms = len(load_scenario(scenario).controllers) if scenario else 1
    if arms > 1:
        world = World(scenario, settings=draw_arms(number, seed), set=name, number=number, arms=arms)
        if drives:
            drive, sensor, drawn = draw_drives(number, seed, scenario)
            settings = (*world.settings, *drawn)
            world = replace(world, sensor=sensor, drive=drive, seed=number, settings=settings)
    else:
        rng = np.random.default_rng((seed, number))
        scenario = scenario or str(rng.choice(scenario_names(1)))
        sensor, kind = str(rng.choice(preset_names("sensors"))), str(rng.choice(KINDS))
        known = load_scenario(scenario, sensor=sensor)
        wrong = {
            what: float(rng.uniform(-SPREAD, SPREAD)) if rng.random() < WRONG else 0.0
            for what in ("mass", "inertia", "friction", "com")
        }
        trouble, path = str(rng.choice(TROUBLES)), motion(kind, known, rng)
        settings = (*path, *world_assignments(known, wrong), *wrench_trouble(trouble, rng))
        drive, noise = "", int(rng.integers(2**31))
        if drives:
            drive, drawn = draw_drive(number, seed, scenario)
            settings = (*path, *drawn)
            wrong = errors_of(known, load_scenario(scenario, assignments=settings))
        if not carries_weight(known, wrong):
            return None
        world = World(scenario, sensor, noise, settings, name, number, motion=kind, drive=drive)
    return long_enough(world) if drives else world


def long_enough(world: World) -> World:
    """Return a world that lasts as long as a law that takes its time needs."""
    path_s = next(iter(world.load("classical").controllers.values())).trajectory.duration_s
    return replace(world, settings=(*world.settings, f"bridge.duration_s={SLOWER * path_s + SETTLES_S}"))


def errors_of(known: Scenario, drawn: Scenario) -> dict[str, float]:
    """Return the relative errors of mass and friction of a drawn world; of friction the least on the way."""
    of, own = drawn.bridge, known.bridge
    left = of.friction.falls_to if of.friction.falls_at_s > 0.0 else 1.0
    slips = of.friction.mu_k if of.friction.model == "coulomb" else of.friction.mu_s
    return {
        "mass": of.object.mass / own.object.mass - 1.0,
        "friction": left * slips / own.friction.mu_s - 1.0,
        "com": 0.0,
    }


def draw_arms(number: int, seed: int) -> tuple[str, ...]:
    """Return how several arms differ from what their controllers are configured with.

    Base of the last arm within 0.3 deg about every axis and 2 mm, its reference up to 10 ms late, friction of its pad
    0.87 to 1 of the others', mass within 10 %, motion in 1.2 to 2 s.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    turn, shift = rng.uniform(-BASE_RAD, BASE_RAD, 3), rng.uniform(-BASE_M, BASE_M, 3)
    late, weak, mass = rng.uniform(0.0, LATE_S), rng.uniform(WEAKEST, 1.0), rng.uniform(1.0 - MASS, 1.0 + MASS)
    return (
        f"mismatch.base_rotation={turn.tolist()}",
        f"mismatch.base_position={shift.tolist()}",
        f"mismatch.late_s={late}",
        f"mismatch.friction={weak}",
        f"mismatch.mass={mass}",
        f"controller.trajectory.duration_s={rng.uniform(FASTEST_S, SLOWEST_S)}",
    )


def draw_drive(number: int, seed: int, scenario: str) -> tuple[str, tuple[str, ...]]:
    """Return a drive, and joints, sensors and friction as they are, for one arm: all troubles at once, none configured.

    The drive is one of ARMS. Mass and friction 0.6 to 1.4, friction that falls on the way, all three friction laws;
    sensors as `_sensors` and joints as `_joints` have them, commands 0 to 4 ms late. Half of the worlds have one of
    MOTION_ARMS instead.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 1)))
    drive = str(rng.choice(ARMS))
    of_motion = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 2)))
    if of_motion.random() < 0.5:
        drive = str(of_motion.choice(MOTION_ARMS))
    known = load_scenario(scenario, drive=drive)
    bridge = known.bridge
    # What is drawn keeps this order, so that a seed keeps its worlds.
    mass, friction = rng.uniform(0.6, 1.4, 2)
    biases, late = _biases(rng), _late_s(rng)
    world = [
        f"bridge.object.mass={bridge.object.mass * mass}",
        f"bridge.friction.mu_s={bridge.friction.mu_s * friction}",
        f"bridge.friction.mu_k={bridge.friction.mu_k * friction}",
        f"bridge.friction.model={rng.choice(('stribeck', 'coulomb', 'lugre'))}",
        *_sensors(biases, rng),
    ]
    if rng.random() < 0.5:
        falls_at = rng.uniform(0.2, 1.0) * known.controller.trajectory.duration_s
        world += [f"bridge.friction.falls_at_s={falls_at}", f"bridge.friction.falls_to={rng.uniform(0.7, 1.0)}"]
    return drive, (*drive_assignments(drive, scenario, ()), *world, *_joints(drive, bridge, late, rng, of_motion))


def draw_drives(number: int, seed: int, scenario: str) -> tuple[str, str, tuple[str, ...]]:
    """Return drive and slip sensor of several arms, and their drives, joints and sensors as they are.

    One drive of ARMS and MOTION_ARMS for all; what `_sensors` and `_joints` draw is each arm's own.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 1)))
    drive, sensor = str(rng.choice((*ARMS, *MOTION_ARMS))), str(rng.choice(preset_names("sensors")))
    world = list(drive_assignments(drive, scenario, ()))
    for arm, known in load_scenario(scenario, drive=drive).bridges.items():
        own = (*_sensors(_biases(rng), rng), *_joints(drive, known, _late_s(rng), rng, rng))
        world += [f"{arm}.{one}" for one in own]
    return drive, sensor, tuple(world)


def _biases(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return biases of wrench sensor, to BIAS_FORCE, and slip sensor, to 10 mm/s."""
    force, slip = rng.normal(size=3), rng.normal(size=2)
    force *= rng.uniform(0.0, BIAS_FORCE) / length(force)
    slip *= rng.uniform(0.0, 0.01) / length(slip)
    return force, slip


def _late_s(rng: np.random.Generator) -> float:
    """Return how late commands are [s], 0 to 4 ms."""
    return float(rng.integers(0, 5)) * 1e-3


def _sensors(biases: tuple[Array, Array], rng: np.random.Generator) -> tuple[str, ...]:
    """Return biased sensors; wrench noise NOISE_FORCE; slip gain 0.7 to 1.1, outliers 2 %, dropouts to 30 %."""
    force, slip = biases
    return (
        f"bridge.sensors.wrench.bias={[*force.tolist(), 0.0, 0.0, 0.0]}",
        f"bridge.sensors.wrench.noise_force={NOISE_FORCE}",
        f"bridge.sensors.slip.faults.gain={rng.uniform(0.7, 1.1)}",
        f"bridge.sensors.slip.faults.bias={[*slip.tolist(), 0.0, 0.0, 0.0, 0.0]}",
        "bridge.sensors.slip.faults.outlier_probability=0.02",
        f"bridge.sensors.slip.faults.dropout_probability={rng.uniform(0.0, 0.3)}",
    )


def _joints(
    drive: str, known: BridgeParams, late_s: float, rng: np.random.Generator, of_motion: np.random.Generator
) -> tuple[str, ...]:
    """Return joints that are not as the preset of their drive says.

    Of measured torque: offset to 0.2 N m, friction to 0.3 of COULOMB, velocity noise to 0.01 rad/s, efforts late. Of
    MOTION_ARMS: commands later than configured, bandwidth within BANDWIDTH of it, velocity noise to 0.01 rad/s.
    """
    joints = len(known.joint_names)
    noise, offset, share = rng.uniform(0.0, 0.01), rng.uniform(0.0, 0.2, joints), rng.uniform(0.0, 0.3)
    if drive in MOTION_ARMS:
        return (
            f"bridge.drive.bandwidth={known.drive.bandwidth * of_motion.uniform(1.0 - BANDWIDTH, 1.0 + BANDWIDTH)}",
            f"bridge.drive.delay_s={known.drive.delay_s + late_s}",
            f"bridge.sensors.joint.noise_velocity={noise}",
        )
    if drive == "motor_current":
        return (f"bridge.drive.delay_s={max(late_s, 0.002)}",)
    return (
        f"bridge.sensors.joint.noise_velocity={noise}",
        f"bridge.drive.offset={(offset * rng.choice((-1.0, 1.0), joints)).tolist()}",
        f"bridge.drive.coulomb={(share * np.array(coulomb_of(joints))).tolist()}",
        f"bridge.drive.delay_s={late_s}",
        "controller.tare.duration_s=0.3",
    )


def world_assignments(known: Scenario, wrong: Mapping[str, float]) -> list[str]:
    """Return what makes the simulated world differ from what the controller is configured with."""
    bridge = known.bridge
    position = [value * (1.0 + wrong["com"]) for value in bridge.contacts.position[:3]]
    return [
        f"bridge.object.mass={bridge.object.mass * (1.0 + wrong['mass'])}",
        f"bridge.object.inertia={[value * (1.0 + wrong['inertia']) for value in bridge.object.inertia]}",
        f"bridge.contacts.position={position + list(bridge.contacts.position[3:])}",
        f"bridge.friction.mu_s={bridge.friction.mu_s * (1.0 + wrong['friction'])}",
        f"bridge.friction.mu_k={bridge.friction.mu_k * (1.0 + wrong['friction'])}",
    ]


def wrench_trouble(trouble: str, rng: np.random.Generator) -> list[str]:
    """Return what is wrong with the wrench sensor."""
    if trouble == "bias":
        direction = rng.normal(size=3)
        force = rng.uniform(0.0, BIAS_FORCE) * direction / length(direction)
        return [f"bridge.sensors.wrench.bias={[*force.tolist(), 0.0, 0.0, 0.0]}"]
    if trouble == "latency":
        return [f"bridge.sensors.wrench.latency_s={float(rng.uniform(*LATENCY_S)):.4f}"]
    if trouble.startswith("noise"):
        known = [f"controller.wrench_sensor.noise_force={NOISE_FORCE}"] if trouble == "noise configured" else []
        return [f"bridge.sensors.wrench.noise_force={NOISE_FORCE}", *known]
    return []


def motion(kind: str, known: Scenario, rng: np.random.Generator) -> list[str]:
    """Return the trajectory parameters of a kind, in the plane of the scenario's own motion, at most as fast.

    Curves turn with 0.4 to 1 of the largest acceleration of the scenario's own motion.
    """
    own = known.controller.trajectory
    way, turn = np.array(own.displacement), np.array(own.rotation)
    if kind == "waypoints":
        shares = np.array([1.0, 2.0]) / 3.0 + rng.uniform(-0.08, 0.08, 2)
        bend = 0.08 * length(way) * rng.uniform(-1.0, 1.0, 2)
        across = np.cross(turn / length(turn), way / length(way))
        points = [np.concatenate((k * way + b * across, k * turn)) for k, b in zip(shares, bend, strict=True)]
        flat = np.concatenate([*points, way, turn]).tolist()
        return ["controller.trajectory.kind=waypoints", f"controller.trajectory.waypoints={flat}"]
    if kind in ("circle", "lemniscate"):
        plane = {0: "yz", 1: "zx", 2: "xy"}[int(np.argmax(np.abs(turn)))]
        radius = 0.08
        fastest = QUINTIC_PEAK * length(way) / own.duration_s**2
        period = 2.0 * math.pi * math.sqrt(radius / (fastest * rng.uniform(0.4, 1.0)))
        return [
            f"controller.trajectory.kind={kind}", f"controller.trajectory.plane={plane}",
            f"controller.trajectory.radius={radius}", f"controller.trajectory.period_s={period:.4f}",
            f"controller.trajectory.ramp_s={0.5 * period:.4f}", f"controller.trajectory.duration_s={2.0 * period:.4f}",
            f"controller.trajectory.rotation={(0.5 * turn).tolist()}",
        ]  # fmt: skip
    return []


def carries_weight(known: Scenario, wrong: Mapping[str, float]) -> bool:
    """Return whether static friction carries the object's weight at rest, in the attitude of the grasp.

    The object's axes start along those of the world, as in all shipped scenarios.
    """
    bridge = known.bridge
    x, y, z, w = bridge.contacts.orientation_xyzw[:4]
    normal = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    weight = bridge.object.mass * (1.0 + wrong["mass"]) * np.array(bridge.gravity)
    lever = (1.0 + wrong["com"]) * np.array(bridge.contacts.position[:3])
    force = weight - normal * (normal @ weight)
    torque = float(normal @ np.cross(-lever, weight))
    limit = bridge.friction.mu_s * (1.0 + wrong["friction"]) * bridge.grip.force
    return math.hypot(length(force), torque / bridge.friction.torsional_radius) < limit
