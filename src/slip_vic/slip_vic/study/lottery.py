"""The lottery: cases that nothing was tuned for, drawn from a seed, each run with several configurations here.

A case is a scenario, a motion, a sensor, a simulated world that differs from the controller's configuration, and one
trouble of the wrench sensor. A configuration is a list of assignments, so laws are compared in equal worlds.
"""

from __future__ import annotations

import contextlib
import csv
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import NamedTuple, cast

import numpy as np
from rich.table import Table

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_sim_bridge.params import BridgeParams
from slip_vic.presets import preset_names
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import Outcome, judge
from slip_vic.run.metrics import off_goal_m
from slip_vic.run.track import Track
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Estimator, Law, Scenario, drive_assignments, load_scenario
from slip_vic.study.cases import coulomb_of
from slip_vic.study.engines import Died, open_engine

SPREAD = 0.3
"""Largest relative error of what the controller is configured with: mass, inertia, friction, centre of mass."""
WRONG = 0.6
"""Share of cases in which each of them is wrong."""
BIAS_FORCE = 0.1
NOISE_FORCE = 0.05
LATENCY_S = (0.001, 0.005)
KINDS = ("scenario", "waypoints", "circle", "lemniscate")
TROUBLES = ("none", "bias", "noise configured", "noise unconfigured", "latency")
QUINTIC_PEAK = 5.7735
"""Largest acceleration of a quintic from rest to rest over way / duration^2."""
WORSE_M = 5e-4
"""Slip by which a law may exceed classical control before it counts as worse."""
MORE_M = 1e-3
"""Slip by which a law may exceed classical control, where both keep the object, before it is counted."""
SLIPPERY_M = 5e-3
"""Slip of classical control above which a law is compared by ratio."""
NEAR_M = 5e-3
"""Distance from the goal within which a pad has come to it."""


@dataclass(frozen=True, slots=True)
class Ticket:
    """One drawn case.

    number: in its lottery; kind: of the motion; world: assignments of the simulated world and of the motion;
    wrong: the drawn relative errors by name; trouble: of the wrench sensor; feasible: friction carries the weight.
    """

    number: int
    scenario: str
    kind: str
    sensor: str
    seed: int
    world: tuple[str, ...]
    wrong: Mapping[str, float]
    trouble: str
    feasible: bool

    def load(self, law: Entry) -> Scenario:
        """Return the scenario of this case with a configuration."""
        return load_scenario(
            self.scenario,
            law=law.law,
            sensor=self.sensor,
            seed=self.seed,
            estimator=law.estimator if self.sensor else None,
            assignments=(*self.world, *law.assignments),
        )


@dataclass(frozen=True, slots=True)
class Entry:
    """A configuration that takes part."""

    name: str
    law: Law = "vic"
    estimator: Estimator | None = "observer"
    assignments: tuple[str, ...] = ()


CLASSICAL = Entry("classical", "classical", None)
OBSERVER = Entry("law + observer")
GOVERNED = Entry("governed + observer", "governed")
LAWS = (CLASSICAL, OBSERVER, GOVERNED)
PRINTED = Entry("printed", "vic", "measured", ("controller.gains.spin=follow", "controller.gains.authority=printed"))
"""The law as printed, with the samples of the slip sensor as they come."""
OF_LAW = {"classical": CLASSICAL, "vic": OBSERVER, "governed": GOVERNED, "printed": PRINTED}
SLOWER, SETTLES_S = 3.0, 5.0
"""How many times the time of its path a case with drives lasts, and for how long an arm with friction then comes to its
goal [s]."""
ARMS = ("ideal", "torque_joint", "motor_current")
MOTION_ARMS = ("velocity_500", "velocity_125", "position_250")
"""Drives that are drawn: those that take efforts, and those that take velocities or positions."""
BANDWIDTH = 0.3
"""Largest relative error of the told bandwidth of a drive with a loop of its own."""
BASE_RAD, BASE_M, LATE_S = 0.3 * np.pi / 180.0, 0.002, 0.01
WEAKEST, MASS = 0.87, 0.1
FASTEST_S, SLOWEST_S = 1.2, 2.0
"""Of several arms: error of the last base, lateness of its reference, its friction over that of the first, error of the
mass, time of the motion."""


class Drawn(NamedTuple):
    """Outcome of one case with one law; slip [m] and [rad] at the end, largest slip speed [m/s], arrival [s].

    arrival: since when the pad stays within 1 mm and 0.5 deg of the goal; NaN where it does not arrive. off_goal: how
    far it ends from the goal [m].
    """

    outcome: Outcome
    reason: str
    slip: float
    angle: float
    peak_speed: float
    drift: float
    arrival: float
    off_goal: float


REFUSED = Drawn("refused", "", *(math.nan,) * 6)


def length(vector: Array) -> float:
    """Return the length of a vector, to the same bits on every processor: numpy's depends on its instruction set."""
    total = 0.0
    for value in vector.tolist():
        total += value * value
    return math.sqrt(total)


def draw(number: int, seed: int) -> Ticket:
    """Return case `number` of the lottery with this seed: the same one whatever else is drawn."""
    return _draw(number, np.random.default_rng((seed, number)), "")


def draw_of(number: int, seed: int, scenarios: Sequence[str]) -> Ticket:
    """Return case `number` of a lottery among some scenarios; with several arms its world is that of `draw_arms`."""
    scenario = scenarios[number % len(scenarios)]
    if has_several_arms(scenario):
        return draw_arms(number, seed, scenario)
    return _draw(number, np.random.default_rng((seed, number)), scenario)


def has_several_arms(scenario: str) -> bool:
    """Return whether several arms hold the object."""
    return len(load_scenario(scenario).controllers) > 1


def draw_arms(number: int, seed: int, scenario: str) -> Ticket:
    """Return a world of several arms that their controllers do not know: its numbers depend on number and seed alone.

    Base of the last arm within 0.3 deg about every axis and 2 mm, its reference up to 10 ms late, friction of its pad
    0.87 to 1 of the others', mass within 10 %, motion in 1.2 to 2 s.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    turn, shift = rng.uniform(-BASE_RAD, BASE_RAD, 3), rng.uniform(-BASE_M, BASE_M, 3)
    late, weak, mass = rng.uniform(0.0, LATE_S), rng.uniform(WEAKEST, 1.0), rng.uniform(1.0 - MASS, 1.0 + MASS)
    world = (
        f"mismatch.base_rotation={turn.tolist()}",
        f"mismatch.base_position={shift.tolist()}",
        f"mismatch.late_s={late}",
        f"mismatch.friction={weak}",
        f"mismatch.mass={mass}",
        f"controller.trajectory.duration_s={rng.uniform(FASTEST_S, SLOWEST_S)}",
    )
    wrong = {"mass": mass - 1.0, "friction": weak - 1.0}
    return Ticket(number, scenario, "scenario", "", 0, world, wrong, "none", True)


def _draw(number: int, rng: np.random.Generator, wanted: str) -> Ticket:
    scenario = wanted or str(rng.choice(scenario_names(1)))
    sensor, kind = str(rng.choice(preset_names("sensors"))), str(rng.choice(KINDS))
    known = load_scenario(scenario, sensor=sensor)
    wrong = {
        what: float(rng.uniform(-SPREAD, SPREAD)) if rng.random() < WRONG else 0.0
        for what in ("mass", "inertia", "friction", "com")
    }
    trouble = str(rng.choice(TROUBLES))
    world = (*motion(kind, known, rng), *world_assignments(known, wrong), *wrench_trouble(trouble, rng))
    return Ticket(
        number, scenario, kind, sensor, int(rng.integers(2**31)), world, wrong, trouble, carries_weight(known, wrong)
    )


def draw_drive(number: int, seed: int, scenario: str, *, interfaces: bool = False) -> tuple[str, ...]:
    """Return drives, joints and sensors as they are, for a case of one arm: all troubles at once, none configured.

    The drive is one of ARMS. Mass and friction 0.6 to 1.4, friction that falls on the way, all three friction laws;
    sensors as `_sensors` and joints as `_joints` have them, commands 0 to 4 ms late. With `interfaces` half of the
    cases have one of MOTION_ARMS instead.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 1)))
    drive = str(rng.choice(ARMS))
    of_motion = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 2)))
    if interfaces and of_motion.random() < 0.5:
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
    return (*drive_assignments(drive, scenario, ()), *world, *_joints(drive, bridge, late, rng, of_motion))


def draw_drives(number: int, seed: int, scenario: str) -> tuple[str, tuple[str, ...]]:
    """Return the slip sensor of a case of several arms, and their drives, joints and sensors as they are.

    One drive of ARMS and MOTION_ARMS for all; what `_sensors` and `_joints` draw is each arm's own.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, 1)))
    drive, sensor = str(rng.choice((*ARMS, *MOTION_ARMS))), str(rng.choice(preset_names("sensors")))
    world = list(drive_assignments(drive, scenario, ()))
    for arm, told in load_scenario(scenario, drive=drive).bridges.items():
        own = (*_sensors(_biases(rng), rng), *_joints(drive, told, _late_s(rng), rng, rng))
        world += [f"{arm}.{one}" for one in own]
    return sensor, tuple(world)


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
    drive: str, told: BridgeParams, late_s: float, rng: np.random.Generator, of_motion: np.random.Generator
) -> tuple[str, ...]:
    """Return joints that are not as the preset of their drive says.

    Of measured torque: offset to 0.2 N m, friction to 0.3 of COULOMB, velocity noise to 0.01 rad/s, efforts late. Of
    MOTION_ARMS: commands later than told, bandwidth within BANDWIDTH of what is told, velocity noise to 0.01 rad/s.
    """
    joints = len(told.joint_names)
    noise, offset, share = rng.uniform(0.0, 0.01), rng.uniform(0.0, 0.2, joints), rng.uniform(0.0, 0.3)
    if drive in MOTION_ARMS:
        return (
            f"bridge.drive.bandwidth={told.drive.bandwidth * of_motion.uniform(1.0 - BANDWIDTH, 1.0 + BANDWIDTH)}",
            f"bridge.drive.delay_s={told.drive.delay_s + late_s}",
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


def with_drive(ticket: Ticket, seed: int, *, interfaces: bool = False) -> Ticket:
    """Return a case with drives, joints and sensors as they are; one of one arm, feasible where friction carries."""
    if has_several_arms(ticket.scenario):
        sensor, drawn = draw_drives(ticket.number, seed, ticket.scenario)
        return replace(ticket, sensor=sensor, seed=ticket.number, world=(*ticket.world, *drawn), trouble="all")
    drawn = draw_drive(ticket.number, seed, ticket.scenario, interfaces=interfaces)
    path = tuple(one for one in ticket.world if one.startswith("controller.trajectory."))
    ticket = replace(ticket, world=(*path, *drawn), trouble="all")
    of, known = ticket.load(CLASSICAL).bridge, load_scenario(ticket.scenario).bridge
    left = of.friction.falls_to if of.friction.falls_at_s > 0.0 else 1.0
    slips = of.friction.mu_k if of.friction.model == "coulomb" else of.friction.mu_s
    wrong = {
        "mass": of.object.mass / known.object.mass - 1.0,
        "friction": left * slips / known.friction.mu_s - 1.0,
        "com": 0.0,
    }
    return replace(ticket, wrong=wrong, feasible=carries_weight(load_scenario(ticket.scenario), wrong))


def long_enough(ticket: Ticket) -> Ticket:
    """Return a case that lasts as long as a law that takes its time needs."""
    path_s = next(iter(ticket.load(CLASSICAL).controllers.values())).trajectory.duration_s
    return replace(ticket, world=(*ticket.world, f"bridge.duration_s={SLOWER * path_s + SETTLES_S}"))


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


def play(ticket: Ticket, law: Entry) -> Drawn:
    """Run one case with one law; parameters that are refused and a simulation that diverges are outcomes."""
    try:
        return _play(ticket.load(law))
    except SlipVicError as error:
        return REFUSED._replace(reason=str(error))


def _play(scenario: Scenario) -> Drawn:
    track = Track(scenario, whole=False)
    verdict = judge(run_in_process(scenario), track)
    kept = verdict.outcome not in ("lost", "fault")
    names = ("slip_linear_m", "slip_angular_rad", "slip_speed_peak_m_s", "error_peak_m", "arrival_s")
    slip, angle, peak_speed, drift, arrival = map(verdict.worst, names)
    pairs = zip(track.series(), scenario.controllers.values(), strict=True) if kept else ()
    off_goal = max((off_goal_m(series, params) for series, params in pairs), default=math.nan)
    reason = "" if kept else verdict.reason
    return Drawn("ok" if kept else verdict.outcome, reason, slip, angle, peak_speed, drift, arrival, off_goal)


def lottery(
    cases: int,
    seed: int,
    jobs: int,
    scenarios: Sequence[str] = (),
    laws: Sequence[str] = tuple(OF_LAW),
    assignments: Sequence[str] = (),
    *,
    drives: bool = False,
) -> Iterator[tuple[Ticket, dict[str, Drawn]]]:
    """Yield every feasible case of a lottery with what each law makes of it, in their order; `cases` are drawn.

    Args:
        cases: how many are drawn.
        seed: of the lottery.
        jobs: worker processes.
        scenarios: which take turns; none: one with one arm is drawn.
        laws: which take part.
        assignments: overrides of every case.
        drives: whether drives and joints are drawn too, and everything else that `draw_drive` and `draw_drives` draw.
    """
    shared = _Shared(seed, tuple(scenarios), tuple(laws), tuple(assignments), drives)
    with open_engine("pool", jobs) as engine:
        waiting: dict[int, tuple[Ticket, dict[str, Drawn]]] = {}
        wanted = 0
        for number, result in engine.run(_drawn_and_played, shared, range(cases)):
            if isinstance(result, Died):
                raise SlipVicError(f"case {number} of the lottery: {result.reason}")
            waiting[number] = result
            while wanted in waiting:
                ticket, results = waiting.pop(wanted)
                wanted += 1
                if results:
                    yield ticket, results


class _Shared(NamedTuple):
    """What all cases of a lottery share."""

    seed: int
    scenarios: tuple[str, ...]
    laws: tuple[str, ...]
    assignments: tuple[str, ...]
    drives: bool


def entry_of(law: str, ticket: Ticket) -> Entry:
    """Return the configuration of a law in a case; several arms have laws of their own, one of them printed too."""
    of_one_arm = law != PRINTED.name or not has_several_arms(ticket.scenario)
    return OF_LAW[law] if law in OF_LAW and of_one_arm else Entry(law, cast(Law, law))


def _drawn_and_played(shared: _Shared, number: int) -> tuple[Ticket, dict[str, Drawn]]:
    ticket = draw_of(number, shared.seed, shared.scenarios) if shared.scenarios else draw(number, shared.seed)
    if shared.drives:
        ticket = long_enough(with_drive(ticket, shared.seed, interfaces=True))
    ticket = replace(ticket, world=(*ticket.world, *shared.assignments))
    entries = [entry_of(law, ticket) for law in shared.laws]
    return ticket, {entry.name: play(ticket, entry) for entry in entries} if ticket.feasible else {}


class Score(NamedTuple):
    """How a law compares with classical control over some cases.

    lost: object lost or FAULT; lost_alone: where classical control keeps it; worse: slips more by WORSE_M or is lost
    alone; more: slips more by MORE_M where both keep it; near: ends within NEAR_M of its goal; ratio: median of
    classical slip over the law's where classical control slips more than SLIPPERY_M.
    """

    cases: int
    lost: int
    classical_lost: int
    lost_alone: int
    worse: int
    more: int
    near: int
    ratio: float


def score(results: Sequence[tuple[Ticket, Mapping[str, Drawn]]], law: str) -> Score:
    """Return the score of a law."""
    pairs = [(by_law.get(CLASSICAL.name, by_law[law]), by_law[law]) for _, by_law in results]
    ratios = [
        (a.slip / max(b.slip, 1e-9)) if b.outcome == "ok" else 0.0
        for a, b in pairs
        if a.outcome != "ok" or a.slip > SLIPPERY_M
    ]
    return Score(
        len(pairs),
        sum(b.outcome != "ok" for _, b in pairs),
        sum(a.outcome != "ok" for a, _ in pairs),
        sum(a.outcome == "ok" and b.outcome != "ok" for a, b in pairs),
        sum(a.outcome == "ok" and (b.outcome != "ok" or b.slip > a.slip + WORSE_M) for a, b in pairs),
        sum(a.outcome == b.outcome == "ok" and b.slip > a.slip + MORE_M for a, b in pairs),
        sum(b.outcome == "ok" and b.off_goal <= NEAR_M for _, b in pairs),
        median(ratios) if ratios else math.nan,
    )


def lottery_table(results: Sequence[tuple[Ticket, Mapping[str, Drawn]]]) -> Table:
    """Return how the laws compare with classical control, per scenario and over all."""
    table = Table(title="lottery: laws against classical control in equal worlds")
    titles = (
        "scenario", "law", "cases", "lost", "classical lost", "lost alone", "worse", "1 mm more", "within 5 mm of goal",
        "median ratio",
    )  # fmt: skip
    for name in titles:
        table.add_column(name, justify="left" if name in ("scenario", "law") else "right")
    names = dict.fromkeys(ticket.scenario for ticket, _ in results)
    entries = dict.fromkeys(name for _, by_law in results for name in by_law if name != CLASSICAL.name)
    for scenario in (*sorted(names), "all"):
        chosen = [result for result in results if scenario in ("all", result[0].scenario)]
        for law in entries:
            found = score(chosen, law)
            counts = (found.cases, found.lost, found.classical_lost, found.lost_alone, found.worse, found.more)
            near = f"{found.near} of {found.cases - found.lost}"
            table.add_row(scenario, law, *map(str, counts), near, f"{found.ratio:.3g}")
    return table


@contextlib.contextmanager
def lottery_file(path: Path) -> Iterator[Callable[[Ticket, Mapping[str, Drawn]], None]]:
    """Open a table with a row per case and law; yield what writes those of a case, which are on the disk at once."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(("number", "scenario", "kind", "sensor", "seed", "trouble", "world", "law", *Drawn._fields))

        def write(ticket: Ticket, by_law: Mapping[str, Drawn]) -> None:
            case = (ticket.number, ticket.scenario, ticket.kind, ticket.sensor, ticket.seed, ticket.trouble)
            rows.writerows((*case, " ".join(ticket.world), law, *drawn) for law, drawn in by_law.items())
            file.flush()

        yield write
