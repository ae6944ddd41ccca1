"""A finished run: outcome, numbers, every tick as a table, and the page; from any source of data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from slip_core.arrays import Array
from slip_core.types import AXES
from slip_vic.run.data import RunData
from slip_vic.run.metrics import summarise

if TYPE_CHECKING:
    import pandas as pd

    from slip_vic.scenarios.scenario import Scenario

Outcome = Literal["ok", "lost", "fault", "refused", "saturated", "held", "crashed", "failed"]
"""lost: the object left a pad, the pad left its path, or the simulation diverged. fault: the controller is in FAULT.
refused: inconsistent parameters, or a path that cannot be followed. saturated: the arm lacks effort. held: the law
never started, or was interrupted by HOLD. crashed: a process died. failed: your own law raised or returned invalid
numbers."""

ENDS: Final = ("lost", "fault")
"""Outcomes that end a run."""


@dataclass(frozen=True)
class Run:
    """A run of a scenario: outcome, reason (empty if it is ok) and its data.

        run = slip_vic.load("paper_planar", law="governed").run()
        print(run.slip_mm, run.outcome)
        run.frame().plot(x="time_s", y="slip_linear_mm")
        run.page("out/run.html")

    With several arms, a number is that of the worst one.
    """

    scenario: Scenario
    outcome: Outcome
    reason: str
    data: RunData

    @cached_property
    def summary(self) -> dict[str, dict[str, Any]]:
        """All numbers of each arm by its name, in SI units; see `slip_vic.run.metrics.summarise`."""
        names = self.scenario.controllers if self.data.arms else ()
        found = {name: summarise(self.data.arm(name)) for name in names}
        if self.outcome in ENDS:
            for numbers in found.values():
                numbers["arrival_s"] = math.nan
        return found

    def worst(self, name: str) -> float:
        """Return the largest of a number of `summary` over the arms; NaN where there is none."""
        return max((float(numbers[name]) for numbers in self.summary.values()), default=math.nan)

    @property
    def slip_mm(self) -> float:
        """How far the pad has slid on the object at the end [mm]."""
        return 1e3 * self.worst("slip_linear_m")

    @property
    def slip_deg(self) -> float:
        """How far the object has turned in the grasp at the end [deg]."""
        return math.degrees(self.worst("slip_angular_rad"))

    @property
    def final_error_mm(self) -> float:
        """How far the pad is from its goal at the end [mm]."""
        return 1e3 * self.worst("final_error_m")

    @property
    def arrival_s(self) -> float:
        """Time from which the pad stays within 1 mm and 0.5 degrees of its goal [s]; NaN if it does not."""
        return self.worst("arrival_s")

    @property
    def internal_force_n(self) -> float:
        """The largest internal force between several arms in the slip plane [N]; NaN for one arm."""
        rows = [arm.channels["internal"].rows for arm in self.data.arms if "internal" in arm.channels]
        return float(max((np.linalg.norm(own[:, :2], axis=1).max() for own in rows), default=math.nan))

    @property
    def modes(self) -> dict[str, tuple[tuple[float, str], ...]]:
        """The changes of mode of each arm: time [s], mode and reason."""
        return {name: self.data.arm(name).modes for name in self.summary}

    def frame(self, arm: str = "") -> pd.DataFrame:
        """Return every tick as a row.

        Columns: time_s; slip_*, slip_velocity_* (pad axes) with their norms slip_linear_mm, slip_angular_deg; wrench_*
        {ee}; object_* [m]; q_*, qd_*, effort_* of the joints; then every symbol of the law by its name, NaN if it was
        not evaluated.

        Args:
            arm: which one; "": the first.

        Raises:
            InputError: no arm of that name.
        """
        import pandas as pd

        data = self.data.arm(arm)
        rows = {name: channel.rows for name, channel in data.channels.items()}
        columns: dict[str, Array] = {
            "time_s": data.channel("slip").times,
            "slip_linear_mm": 1e3 * np.linalg.norm(rows["slip"][:, :3], axis=1),
            "slip_angular_deg": np.degrees(np.linalg.norm(rows["slip"][:, 3:], axis=1)),
        }
        for name in ("slip", "slip_velocity", "wrench"):
            columns |= {f"{name}_{axis}": rows[name][:, j] for j, axis in enumerate(AXES)}
        pose = self.data.object_pose
        assert pose is not None
        columns |= {f"object_{axis}": pose.rows[:, j] for j, axis in enumerate("xyz")}
        for name, short in (("joints", "q"), ("joint_velocity", "qd"), ("effort", "effort")):
            columns |= {f"{short}_{j + 1}": rows[name][:, j] for j in range(rows[name].shape[1])}
        columns |= {name: rows["law"][:, j] for j, name in enumerate(data.symbols) if name not in columns}
        return pd.DataFrame(columns)

    def page(self, path: str | Path) -> Path:
        """Write the page of the run, one HTML file with a 3D replay and linked plots; return its path.

        Raises:
            InputError: a file that cannot be written.
        """
        from slip_vic.page import require_page

        require_page()
        from slip_vic.page.page import write_page

        label = str(self.scenario.law)
        ends = {label: self.reason} if self.reason else {}
        write_page(Path(path), {label: self.data}, command="slip_vic.Run.page", ends=ends)
        return Path(path)

    def sentence(self, arm: str | None = None) -> str:
        """Return a sentence with slip, goal error and arrival of an arm; None: of the worst."""
        names = "slip_linear_m", "slip_angular_rad", "final_error_m", "arrival_s"
        slip, turn, error, arrival = (self.worst(name) if arm is None else self.summary[arm][name] for name in names)
        parts = [f"slip {1e3 * slip:.2f} mm, {math.degrees(turn):.2f} deg"]
        parts += [] if math.isnan(error) else [f"goal error {1e3 * error:.3f} mm"]
        return "; ".join([*parts, "does not arrive" if math.isnan(arrival) else f"arrives after {arrival:.2f} s"])

    def __repr__(self) -> str:
        why = f" ({self.reason})" if self.reason else ""
        return f"Run({self.scenario.name}, {self.scenario.law}: {self.outcome}{why}, {self.sentence()})"
