"""The verdict on a set of gains, as a table with the reason of every line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from slip_bringup.scenario import Estimator, controller_values, load_scenario
from slip_core.params import build, flat_names, load_yaml
from slip_vic_controller.law.bounds import GainReport, judge_gains
from slip_vic_controller.node_params import ControllerNodeParams
from slip_vic_controller.params import ControllerParams


def check_table(
    scenario: str, file: Path | None, sensor: str, estimator: Estimator | None, assignments: Sequence[str]
) -> tuple[Table, bool]:
    """Return the table, and whether the gains would be accepted.

    Raises:
        InputError: unknown scenario, sensor or parameter, an unreadable file, an arm that cannot follow the path.
    """
    load_scenario(scenario, assignments=assignments).check_arm()
    extra = {} if file is None else _read(file)
    values = controller_values(scenario, sensor, estimator, extra, assignments)
    params = build(ControllerNodeParams, values, str(file or scenario))
    assert isinstance(params, ControllerParams)
    report = judge(params)
    return _table(params, report, sensor), all(condition.holds for condition in report.conditions)


def judge(params: ControllerParams) -> GainReport:
    """Return the verdict on parameters without refusing them."""
    direct = params.slip_estimator == "measured"
    return judge_gains(
        np.array(params.gains.damping),
        params.gains.k_s,
        params.gains.k_s_mode,
        gain_margin=params.gains.k_s_margin,
        control_period_s=params.control_period_s,
        sensor_period_s=params.slip_sensor.period_s if direct else 0.0,
        latency_s=params.slip_sensor.latency_s if direct else 0.0,
    )


def _read(file: Path) -> dict[str, Any]:
    """Return the parameters of a ROS parameter file (of the first node in it) or of a plain one."""
    content = load_yaml(file)
    for node in content.values():
        if isinstance(node, dict) and "ros__parameters" in node:
            return flat_names(node["ros__parameters"])
    return flat_names(content)


def _table(params: ControllerParams, report: GainReport, sensor: str) -> Table:
    title = f"k_s asked {report.asked:g}, used {report.used:.6g} 1/s ({params.gains.k_s_mode}, {params.slip_estimator}"
    table = Table(title=f"{title}{', ' + sensor if sensor else ''})")
    for name in ("condition", "value", "limit", "margin", "verdict", "reason"):
        table.add_column(name, justify="right" if name in ("value", "limit", "margin") else "left")
    for c in report.conditions:
        verdict = "[green]holds[/]" if c.holds else "[red]fails[/]"
        table.add_row(c.name, f"{c.value:.6g}", f"{c.limit:.6g}", f"{c.margin:.3g}", verdict, c.reason)
    for name, (low, high) in (("lambda_1", report.lambda_1), ("lambda_2", report.lambda_2)):
        empty = low >= high
        table.add_row(
            name, f"{low:.4g}", f"{high:g}", "", "[red]empty[/]" if empty else "[green]exists[/]",
            "between these two numbers" if not empty else "no number below 1 is large enough",
        )  # fmt: skip
    return table
