"""The verdict on a recorded run: identical to the last bit, or where it first differs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slip_core.files.plain_yaml import parse_json
from slip_vic.replay.replay import Divergence, replay
from slip_vic.replay.run_data import RecordedRun
from slip_vic.run.versions import git_revision, versions

KINDS = {"effort": "efforts", "velocity": "velocities", "position": "positions"}


@dataclass(frozen=True, slots=True)
class Comparison:
    """How many cycles and commanded numbers were compared, how many cycles differ, and the first difference."""

    cycles: int
    numbers: int
    kind: str  # of them: efforts, velocities or positions
    different: int
    first: Divergence | None

    @property
    def identical(self) -> bool:
        """Whether not one bit differs."""
        return self.first is None

    def text(self) -> str:
        """Return the verdict in one line."""
        if self.first is None:
            return f"identical: {self.cycles} cycles, {self.numbers} {self.kind}, to the last bit"
        first = self.first
        return (
            f"differs in {self.different} of {self.cycles} cycles; first in cycle {first.cycle} "
            f"(stamp {first.stamp_ns * 1e-9:.9f} s), {first.topic}, {first.field}: "
            f"recorded {first.recorded!r}, replayed {first.replayed!r}"
        )


def verify_run(runs: Mapping[str, RecordedRun]) -> Comparison:
    """Replay the run of each arm.

    Raises:
        InputError: the run cannot be replayed from its bag.
    """
    different, first = 0, None
    for divergence in replay(runs):
        if divergence is not None:
            different += 1
            first = first or divergence
    numbers = sum(len(command) for run in runs.values() for command in run.commands)
    kind = KINDS[next(iter(runs.values())).params.command.interface]
    return Comparison(sum(len(run.commands) for run in runs.values()), numbers, kind, different, first)


def other_software(custom_data: Mapping[str, str]) -> list[str]:
    """Say what a bag was recorded with that is not the same here: only the same software gives the same bits."""
    notes, revision = [], custom_data.get("git_revision", "")
    if revision and revision != git_revision():
        notes.append(f"recorded with revision {revision}, here it is {git_revision()}")
    try:
        recorded = dict(parse_json(custom_data.get("versions", "{}")))
    except (ValueError, TypeError):
        return notes
    current = versions()
    for name, version in recorded.items():
        if current.get(name) != version:
            notes.append(f"recorded with {name} {version}, here it is {current.get(name, 'not installed')}")
    return notes
