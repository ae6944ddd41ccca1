"""A run that is over: its numbers, every tick as a table, the page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from slip_core.arrays import Array
from slip_core.types import AXES
from slip_vic.run.data import ArmData
from slip_vic.run.judge import Outcome, Verdict
from slip_vic.run.track import Track

if TYPE_CHECKING:
    import pandas as pd

    from slip_vic.scenarios.scenario import Scenario


@dataclass(frozen=True)
class Run:
    """A run of a scenario in this process.

        run = slip_vic.load("paper_planar", law="governed").run()
        print(run.slip_mm, run.outcome)
        run.frame().plot(x="time_s", y="slip_linear_mm")
        run.page("out/run.html")

    Where several arms hold the object, a number is that of the worst of them.
    """

    scenario: Scenario
    verdict: Verdict
    track: Track

    @property
    def outcome(self) -> Outcome:
        """How it ended: ok, lost, fault, refused, saturated or held."""
        return self.verdict.outcome

    @property
    def reason(self) -> str:
        """Why it did not end well, in one line; empty where it did."""
        return self.verdict.reason

    @property
    def slip_mm(self) -> float:
        """How far the pad has slid on the object at the end [mm]."""
        return 1e3 * self.verdict.worst("slip_linear_m")

    @property
    def slip_deg(self) -> float:
        """How far the object has turned in the grasp at the end [deg]."""
        return math.degrees(self.verdict.worst("slip_angular_rad"))

    @property
    def final_error_mm(self) -> float:
        """How far the pad is from its goal at the end [mm]."""
        return 1e3 * self.verdict.worst("final_error_m")

    @property
    def arrival_s(self) -> float:
        """From when on the pad stays within 1 mm and 0.5 degrees of its goal [s]; NaN where it does not."""
        return self.verdict.worst("arrival_s")

    @property
    def internal_force_n(self) -> float:
        """The largest force with which several arms work against each other in the slip plane [N]; NaN of one arm."""
        return float(self.verdict.together.get("internal_peak_n", math.nan))

    @property
    def modes(self) -> dict[str, tuple[tuple[float, str], ...]]:
        """The changes of mode of each arm: from when on [s], mode and reason."""
        return self.track.modes()

    @property
    def summary(self) -> dict[str, dict[str, Any]]:
        """All numbers of each arm by its name, in SI units."""
        return {name: dict(numbers) for name, numbers in self.verdict.arms.items()}

    def frame(self, arm: str | None = None) -> pd.DataFrame:
        """Return every tick as a row.

        Columns: time_s; slip_*, slip_velocity_* (pad axes) with their norms slip_linear_mm, slip_angular_deg;
        wrench_* {ee}; object_* [m]; q_*, qd_*, effort_* of the joints; then every symbol of the law by its name, NaN
        where it was not evaluated.

        Args:
            arm: which one; None: the first.

        Raises:
            InputError: no arm of that name.
        """
        import pandas as pd

        data = self._arm(arm)
        rows = {name: channel.rows for name, channel in data.channels.items()}
        columns: dict[str, Array] = {
            "time_s": data.channel("slip").times,
            "slip_linear_mm": 1e3 * np.linalg.norm(rows["slip"][:, :3], axis=1),
            "slip_angular_deg": np.degrees(np.linalg.norm(rows["slip"][:, 3:], axis=1)),
        }
        for name in ("slip", "slip_velocity", "wrench"):
            columns |= {f"{name}_{axis}": rows[name][:, j] for j, axis in enumerate(AXES)}
        pose = self.track.data().object_pose
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
        write_page(Path(path), {label: self.track.data()}, command="slip_vic.Run.page", ends=ends)
        return Path(path)

    def _arm(self, name: str | None) -> ArmData:
        from slip_core.errors import UnknownName

        arms = {arm.name: arm for arm in self.track.data().arms}
        if name is not None and name not in arms:
            raise UnknownName("arm", name, arms)
        return next(iter(arms.values())) if name is None else arms[name]

    def __repr__(self) -> str:
        why = f" ({self.reason})" if self.reason else ""
        arrives = "does not arrive" if math.isnan(self.arrival_s) else f"arrives after {self.arrival_s:.2f} s"
        return (
            f"Run({self.scenario.name}, {self.scenario.law}: {self.outcome}{why}, slip {self.slip_mm:.2f} mm "
            f"{self.slip_deg:.2f} deg, final error {self.final_error_mm:.3f} mm, {arrives})"
        )
