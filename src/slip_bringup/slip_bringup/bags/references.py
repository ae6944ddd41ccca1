"""The reference bags of the repository: one short run per scenario and controller, recorded over DDS."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, get_args

from slip_bringup.bags.reader import Bag
from slip_bringup.bags.run_data import read_run
from slip_bringup.bags.verify import verify_run
from slip_bringup.launcher import Launcher
from slip_bringup.scenario import ControllerKind, load_scenario
from slip_description import scenario_names
from slip_msgs_py.errors import ProtocolError

DURATION_S: Final = 2.0
SEED: Final = 0
COMMAND: Final = "slip-vic bag references"


def reference_names() -> Iterator[tuple[str, ControllerKind, str]]:
    """Yield (scenario, controller, folder name) of every reference bag."""
    for scenario in scenario_names():
        for controller in get_args(ControllerKind):
            yield scenario, controller, f"{scenario}_{controller}"


def make_references(folder: Path, tell: Callable[[str], None]) -> None:
    """Record all reference bags anew, verify each, and only then replace those in `folder`, with their README.

    Raises:
        ProtocolError: a run lost messages or cannot be reproduced; nothing is replaced then.
    """
    staging = folder / ".new"
    shutil.rmtree(staging, ignore_errors=True)
    staging.mkdir(parents=True)
    try:
        rows = []
        for scenario, controller, name in reference_names():
            loaded = load_scenario(
                scenario, controller=controller, seed=SEED, assignments=(f"bridge.duration_s={DURATION_S}",)
            )
            result = Launcher(loaded, bag=staging / name).run()
            with Bag(staging / name) as bag:
                verdict = verify_run(read_run(bag, {}))
                size = bag.size_bytes
            if result.lost or not verdict.identical:
                raise ProtocolError(f"reference bag {name}: {result.lost} messages lost; {verdict.text()}")
            tell(f"{name}: {verdict.text()}")
            what = " ".join(loaded.description.split())
            rows.append(f"| `{name}` | {size / 2**20:.1f} MiB | {result.messages} | {what} |")
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
            f"Made by `{COMMAND}` (seed {SEED}, the first {DURATION_S:g} s of each scenario, lockstep). Each is",
            "what `slip-vic run --record` writes; a test verifies every one to the last bit, so any change of numbers",
            "in the controller is noticed. Where it is wanted, run the command and commit the result.",
            "",
            "| bag | size | messages | what it shows |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )
