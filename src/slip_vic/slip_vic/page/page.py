"""Bags in, one HTML file out: text, style, scripts and numbers in it, nothing fetched."""

from __future__ import annotations

import contextlib
import html
import json
import os
import string
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from slip_core.errors import InputError
from slip_vic.page.packing import Packer, compressed
from slip_vic.page.plots import describe_plots
from slip_vic.page.runs import Run, colours, describe, drawn, grid
from slip_vic.page.scripts import read_static, three, uplot
from slip_vic.run.data import RunData, read_data
from slip_vic.run.metrics import summarise, summary_rows

if TYPE_CHECKING:
    from slip_vic.run import run

MODULES: Final = (
    "data.js",
    "colours.js",
    "robot.js",
    "scene.js",
    "views.js",
    "plots.js",
    "player.js",
    "live.js",
    "main.js",
)
"""In the order in which the page runs them: each uses what stands before it."""


def write_page(
    path: Path,
    bags: Mapping[str, Path],
    *,
    command: str,
    title: str = "",
    description: str = "",
    ends: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write the page of some recorded runs, given by label.

    `ends` says by label why a run did not end well.

    Raises:
        InputError: a bag that cannot be read or is no run of this suite, or a file that cannot be written.
    """
    if not bags:
        raise InputError("report", got="no bags", expected="recorded runs")
    write_text(path, make_page(bags, command=command, title=title, description=description, ends=ends)[0])


def write_runs(path: Path, made: Mapping[str, run.Run], *, command: str, title: str, description: str = "") -> None:
    """Write the page of runs in this process, given by label.

    Raises:
        InputError: a file that cannot be written.
    """
    data = {label: one.track.data() for label, one in made.items()}
    numbers = {f"{label} {arm}".strip(): summary for label, one in made.items() for arm, summary in one.summary.items()}
    ends = {label: one.reason for label, one in made.items() if one.outcome != "ok"}
    write_text(path, _page(data, numbers, command=command, title=title, description=description, ends=ends))


def write_text(path: Path, text: str) -> None:
    """Write a file that is whole or not there.

    Raises:
        InputError: it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"output {path}", got=error, expected="a file that can be written") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def make_page(
    bags: Mapping[str, Path],
    *,
    command: str,
    title: str = "",
    description: str = "",
    ends: Mapping[str, str] = MappingProxyType({}),
) -> tuple[str, dict[str, dict[str, Any]]]:
    """Return the page as text, and the numbers of its table by label."""
    data = {label: read_data(path) for label, path in bags.items()}
    numbers = {
        f"{label} {arm.name}" if len(run.arms) > 1 else label: summarise(arm)
        for label, run in data.items()
        for arm in run.arms
        if {"slip", "law", "effort"} <= arm.channels.keys()
    }
    return _page(data, numbers, command=command, title=title, description=description, ends=ends), numbers


def _page(
    data: Mapping[str, RunData],
    numbers: Mapping[str, Mapping[str, Any]],
    *,
    command: str,
    title: str,
    description: str,
    ends: Mapping[str, str],
) -> str:
    times = grid(max(run.duration_s for run in data.values()))
    runs: list[Run] = [drawn(run, label, times, ends.get(label, "")) for label, run in data.items()]
    packer = Packer()
    described, missing = [], []
    for run, colour in zip(runs, colours([run.label for run in runs]), strict=True):
        made, lacking = describe(run, packer, colour)
        described.append(made)
        missing += lacking
    scenario = next((run.facts["scenario"] for run in runs if "scenario" in run.facts), "")
    header = {"time": packer.add(times), "runs": described, "plots": describe_plots(runs, packer)}
    facts = {
        "command": command,
        **{name: ", ".join(dict.fromkeys(run.facts[name] for run in runs if name in run.facts)) for name in _FACTS},
        **dict(sorted((k, str(v)) for run in runs for k, v in run.versions.items())),
    }
    return assemble(
        title=title or scenario or "recorded runs",
        description=description,
        table=_table(numbers),
        laws=_laws([run.label for run in runs]),
        facts=_facts({_FACTS.get(name, name): value for name, value in facts.items() if value}),
        notes="".join(f"<p>not drawn: {html.escape(name)}</p>" for name in dict.fromkeys(missing)),
        data=compressed(packer.pack(header)),
        live=False,
    )


LAWS: Final = {
    "classical": "impedance control that follows the path and does not use the slip.",
    "vic": "the paper's law: stiffness fades with slip, and the pad follows the object until the slip is gone.",
    "governed": "the paper's law below a governor that slows the path before the pad slips.",
}
_FACTS: Final = {"scenario": "scenario", "seed": "seed", "git_revision": "revision"}


def assemble(*, live: bool, title: str, data: str, **parts: str) -> str:
    """Return the page with its parts in place; title and description are plain text, the other parts HTML."""
    script, style = uplot()
    values = {
        "title": html.escape(title),
        "description": html.escape(parts.pop("description", "")),
        "style": style + read_static("style.css"),
        "libraries": _script(three()) + _script(script),
        "program": _script(f'(() => {{\n"use strict";\n{"".join(read_static(name) for name in MODULES)}\n}})();'),
        "data": data,
        "live": json.dumps(live),
        **parts,
    }
    return string.Template(read_static("page.html")).substitute(values)


def _script(text: str) -> str:
    return "<script>" + text.replace("</script", "<\\/script") + "</script>\n"


def _table(numbers: Mapping[str, Mapping[str, Any]]) -> str:
    if not numbers:
        return "<p>These bags hold no ground truth of the object, so there are no numbers of its slip.</p>"
    labels = "".join(f'<th scope="col">{html.escape(label)}</th>' for label in numbers)
    rows = "".join(
        f'<tr><th scope="row">{html.escape(row.label)}</th>'
        + "".join(f"<td>{html.escape(text)}</td>" for text in row.texts)
        + "</tr>"
        for row in summary_rows(list(numbers.values()))
    )
    return f'<table id="summary"><thead><tr><td></td>{labels}</tr></thead><tbody>{rows}</tbody></table>'


def _laws(labels: Sequence[str]) -> str:
    """What the laws that are shown are, a line each."""
    return "<br>".join(f"<b>{label}</b>: {LAWS[label]}" for label in labels if label in LAWS)


def _facts(facts: Mapping[str, str]) -> str:
    rows: Sequence[str] = [f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in facts.items()]
    return f"<dl>{''.join(rows)}</dl>"
