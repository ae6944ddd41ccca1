"""Governed where what holds the object, or what measures the arm, is mounted or told otherwise than it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_sim_bridge.params import BridgeParams
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load_scenario
from slip_vic.study.lottery import GOVERNED, draw, long_enough, play, with_drive
from slip_vic_controller.safety.modes import Mode
from test.support.every import every

STICKS_MM = 0.1
BIAS = [0.003, -0.003, 0.003, -0.003, 0.003, -0.003, 0.003]


def tilted(x_deg: float, y_deg: float) -> Callable[[BridgeParams], list[str]]:
    """Return a base that stands askew: gravity in its frame is turned."""
    turn = Rotation.from_rotvec(np.radians((x_deg, y_deg, 0.0)))
    return lambda bridge: [f"bridge.gravity={turn.apply(bridge.gravity).tolist()}"]


def turned(x_deg: float, z_deg: float) -> Callable[[BridgeParams], list[str]]:
    """Return an object that is gripped turned about its pad."""
    turn = Rotation.from_rotvec(np.radians((x_deg, 0.0, z_deg)))

    def words(bridge: BridgeParams) -> list[str]:
        gripped = Rotation.from_quat(bridge.contacts.orientation_xyzw[:4]) * turn
        return [f"bridge.contacts.orientation_xyzw={gripped.as_quat().tolist()}"]

    return words


def moved(x: float, z: float) -> Callable[[BridgeParams], list[str]]:
    """Return an object that is gripped elsewhere [m]."""
    return lambda bridge: [f"bridge.contacts.position={np.add(bridge.contacts.position[:3], (x, 0.0, z)).tolist()}"]


MISMATCHES: dict[str, Callable[[BridgeParams], list[str]]] = {
    "as told": lambda _: [],
    "base tilted by 2 degrees about x": tilted(2.0, 0.0),
    "base tilted by 2 degrees about y": tilted(0.0, 2.0),
    "object gripped turned by 5 degrees about x": turned(5.0, 0.0),
    "object gripped turned by 5 degrees about z": turned(0.0, 5.0),
    "object gripped 8 mm off along x": moved(0.008, 0.0),
    "object gripped 8 mm off along z": moved(0.0, -0.008),
    "inertia three times as large": lambda bridge: [
        f"bridge.object.inertia={(3.0 * np.array(bridge.object.inertia)).tolist()}"
    ],
    "joint positions 3 mrad off": lambda _: [f"bridge.sensors.joint.bias_position={BIAS}"],
    "motors of 0.1 kg m2 at every joint": lambda _: ["bridge.drive.armature=[0.1]"],
    "torques a tenth too small": lambda _: ["bridge.drive.gain=0.9"],
    "wrench sensor askew by 5 degrees": lambda _: [
        f"bridge.sensors.wrench.rotation={np.full(3, math.radians(5.0) / math.sqrt(3.0)).tolist()}"
    ],
    "wrench a tenth too small": lambda _: ["bridge.sensors.wrench.gain=0.9"],
    "wrench that drifts by 0.02 N/s": lambda _: ["bridge.sensors.wrench.drift=[0.02, 0.02, 0.02, 0.0, 0.0, 0.0]"],
    "wrench at 250 Hz, 4 ms late": lambda _: [
        "bridge.sensors.wrench.latency_s=0.004", "bridge.sensors.wrench.rate_hz=250",
    ],
    "joints 3 mrad off, base tilted, wrench noise 0.05 N": lambda bridge: [
        f"bridge.sensors.joint.bias_position={BIAS}", *tilted(1.5, 1.5)(bridge),
        "bridge.sensors.wrench.noise_force=0.05", "bridge.sensors.wrench.noise_torque=0.005",
    ],
}  # fmt: skip


def slipped_mm(drive: str, scenario: str, mismatch: str, law: str = "governed", duration_s: float = 5.0) -> float:
    """Return how far an object slips in a world that nothing was told of [mm]; infinite where it is lost."""
    bridge = load_scenario(scenario, drive=drive).bridge  # type: ignore[arg-type]
    sensor = "event_1000" if drive != "ideal" else ""
    words = (*MISMATCHES[mismatch](bridge), f"bridge.duration_s={duration_s}")
    loaded = load_scenario(scenario, law=law, drive=drive, sensor=sensor, assignments=words)  # type: ignore[arg-type]
    for tick in run_in_process(loaded):
        if any(incident.kind == "lost" for incident in tick.incidents):
            return math.inf
    return 1e3 * float(np.linalg.norm(tick.outputs.truth.slip_displacement[:3]))


@every("scenario", ("paper_planar", "vertical_plane", "glass_transport"))
def test_an_arm_whose_torques_are_too_small_gives_way_and_keeps_the_object(scenario: str) -> None:
    """Held back to what friction would carry if all of it came about, it sank until the object was lost."""
    assert slipped_mm("ideal", scenario, "torques a tenth too small") < STICKS_MM


@every(
    ("drive", "scenario", "mismatch"),
    (
        ("ideal", "vertical_plane", "base tilted by 2 degrees about x"),
        ("ideal", "paper_planar", "base tilted by 2 degrees about y"),
        ("torque_joint", "glass_transport", "joints 3 mrad off, base tilted, wrench noise 0.05 N"),
        ("velocity_500", "vertical_plane", "object gripped turned by 5 degrees about z"),
        ("ideal", "paper_planar", "wrench sensor askew by 5 degrees"),
        ("torque_joint", "vertical_plane", "motors of 0.1 kg m2 at every joint"),
    ),
)
def test_what_is_mounted_otherwise_than_told_makes_nothing_slip(drive: str, scenario: str, mismatch: str) -> None:
    assert slipped_mm(drive, scenario, mismatch, duration_s=3.0) < STICKS_MM


def test_the_law_counts_on_the_motors_that_it_is_told_of() -> None:
    """Told, they change nothing of the law; not told, an arm without an estimator lost the object with `vic`."""
    told = tuple(f"{node}.drive.armature=[0.3,0.3,0.3,0.3,0.1,0.1,0.1]" for node in ("bridge", "controller"))
    slips = []
    for words in ((), told):
        loaded = load_scenario("vertical_plane", law="vic", assignments=(*words, "bridge.duration_s=2.0"))
        for tick in run_in_process(loaded):
            assert tick.result.mode != Mode.FAULT
        slips.append(1e3 * float(np.linalg.norm(tick.outputs.truth.slip_displacement[:3])))
    assert slips[1] == pytest.approx(slips[0], rel=1e-2), "but for the null space, which the inertia weighs"


@every(("seed", "number"), ((606060, 50), (606060, 262), (616161, 197), (808080, 195)))
def test_worlds_of_the_lottery_in_which_governed_slipped_far(seed: int, number: int) -> None:
    """57, 9, 69 and 10 mm: dragged back to the path it had overrun, deceived by an outlier, friction learnt from noise,

    and a slip that outliers kept up, below which the path does not brake.
    """
    result = play(long_enough(with_drive(draw(number, seed), seed)), GOVERNED)
    assert result.outcome == "ok"
    assert 1e3 * result.slip < 5.0


@every(("seed", "number", "most_mm"), ((90909, 19, 2.0), (616161, 91, 9.0), (929292, 257, 2.0), (131313, 6, 0.5)))
def test_worlds_of_the_lottery_in_which_a_camera_shows_low_friction_late(
    seed: int, number: int, most_mm: float
) -> None:
    """10, 18, 5 and 6 mm, more than by classical control: the observer found the first slip late, was not believed, or

    found a slip that was none, after which the path was begun again with all that is told of friction.
    """
    ticket = with_drive(draw(number, seed), seed)
    result = play(replace(ticket, world=(*ticket.world, "bridge.duration_s=2.0")), GOVERNED)
    assert result.outcome == "ok"
    assert 1e3 * result.slip < most_mm


def test_a_world_of_the_lottery_in_which_trembling_pads_stopped_the_path() -> None:
    """It ended 455 mm off its goal, ACTIVE and without a reason."""
    world = long_enough(with_drive(draw(182, 616161), 616161)).load(GOVERNED)
    reasons: dict[tuple[int, ...], str] = {}
    for tick in run_in_process(world):
        if tick.result.reason_key not in reasons:
            reasons[tick.result.reason_key] = tick.result.reason
    assert any("the slip sensor reports slip that does not end" in reason for reason in reasons.values())
    assert tick.result.record.law.error_linear < 5e-3


def main() -> None:
    """Print the table of docs/drives.md."""
    drives, scenarios = (
        ("ideal", "torque_joint", "velocity_500", "position_250"),
        ("paper_planar", "vertical_plane", "glass_transport"),
    )
    print("| |", " | ".join(f"`{drive}`" for drive in drives), "|")
    print("|---" * (1 + len(drives)) + "|")
    for mismatch in MISMATCHES:
        cells = []
        for drive in drives:
            pairs = [
                [slipped_mm(drive, name, mismatch, law) for name in scenarios] for law in ("governed", "classical")
            ]
            said = [
                f"{max(x for x in row if x < math.inf):.2f} mm"
                + (f", {row.count(math.inf)} lost" if math.inf in row else "")
                for row in pairs
            ]
            cells.append(f"{said[0]} ({said[1]})")
        print(f"| {mismatch} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
