"""The reference bags of the repository: one short run per scenario and controller, recorded over DDS."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from slip_bags.reader import Bag
from slip_core.errors import ProtocolError
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.launcher import Launcher
from slip_vic.run.metrics import summarise
from slip_vic.run.series import read_series
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Law, load_scenario

DURATION_S: Final = 2.0
SEED: Final = 0
COMMAND: Final = "slip-vic bag references"
EVERY_TICK: Final = ("/clock", "/joint_states", "/effort_command", "/controller/ledger", "/object_state", "/slip_truth")
LARGEST_BYTES: Final = 2_000_000
SHORT: Final = f"--set bridge.duration_s={DURATION_S}"
CONTROLLERS: Final[dict[Law, str]] = {
    "classical": "Classical impedance control: the arm keeps its path, and the object slips.",
    "vic": "Variable impedance control: stiffness fades with slip and compensation drives it to zero.",
}
PRINTED: Final = ("controller.gains.spin=follow",)
BEYOND_THE_ARM: Final = (
    "controller.safety.limits.effort_rate=20000.0", "controller.safety.limits.velocity_scale=3.0",
    "bridge.effort_rate=20000.0",
)  # fmt: skip
"""What the printed law needs in the scenarios in which the real limits of the arm are too narrow for it."""


def reference_names() -> Iterator[tuple[str, Law, str]]:
    """Yield (scenario, controller, folder name) of every reference bag."""
    for scenario in scenario_names(1):
        for controller in CONTROLLERS:
            yield scenario, controller, f"{scenario}_{controller}"


def settings(scenario: str, controller: Law) -> tuple[str, ...]:
    """Return the assignments of a reference bag: with vic it holds the printed law, to the last bit."""
    if controller != "vic":
        return ()
    bounded = load_scenario(scenario, law=controller).controller.gains.spin == "bounded"
    return (*PRINTED, *BEYOND_THE_ARM) if bounded else ()


def make_references(folder: Path, tell: Callable[[str], None]) -> None:
    """Record all reference bags again, verify each, and only then replace those in `folder`, with their README.

    Raises:
        ProtocolError: a run lost messages or cannot be reproduced; nothing is replaced then.
    """
    staging = folder / ".new"
    shutil.rmtree(staging, ignore_errors=True)
    staging.mkdir(parents=True)
    try:
        rows = []
        for scenario, controller, name in reference_names():
            own = settings(scenario, controller)
            loaded = load_scenario(
                scenario, law=controller, seed=SEED, assignments=(f"bridge.duration_s={DURATION_S}", *own)
            )
            result = Launcher(loaded, bag=staging / name).run()
            with Bag(staging / name) as bag:
                verdict = verify_run(read_run(bag, {}))
                size = bag.size_bytes
                short = [t for t in EVERY_TICK if bag.topic(t).message_count != result.ticks]
            if size > LARGEST_BYTES:
                raise ProtocolError(f"reference bag {name}: {size} bytes, expected at most {LARGEST_BYTES}")
            if result.lost or short or not verdict.identical:
                raise ProtocolError(f"reference bag {name}: {result.lost} lost, short: {short}; {verdict.text()}")
            tell(f"{name}: {verdict.text()}")
            numbers = summarise(read_series(staging / name))
            slip = f"{1e3 * numbers['slip_linear_m']:.2f} mm, {math.degrees(numbers['slip_angular_rad']):.2f} deg"
            what = f"{' '.join(loaded.description.split())} {CONTROLLERS[controller]}"
            chosen = " ".join((SHORT, *(f"--set {assignment}" for assignment in own)))
            command = f"slip-vic run --scenario {scenario} --law {controller} --seed {SEED} {chosen} --record {name}"
            rows.append(f"| `{name}` | {size / 2**20:.2f} MiB | {result.messages} | {slip} | {what} | `{command}` |")
        (staging / "README.md").write_text(_readme(rows), encoding="utf-8")
        for item in sorted(staging.iterdir()):
            target = folder / item.name
            shutil.rmtree(target) if target.is_dir() else target.unlink(missing_ok=True)
            item.replace(target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _readme(rows: list[str]) -> str:
    return "\n".join(
        [
            "# Reference bags",
            "",
            f"Made by `{COMMAND}`: seed {SEED}, the first {DURATION_S:g} s of each scenario with each controller, in",
            "lockstep over DDS, ideal sensors. Each is what the command beside it writes. A test verifies every one to",
            "the last bit, so any change of numbers in the controller is noticed. Where it is wanted, run the command",
            "and commit the result. Open them with `slip-vic bag info`, `ros2 bag play`, Foxglove or PlotJuggler.",
            "",
            "| bag | size | messages | slip at the end | what it shows | command |",
            "|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )
