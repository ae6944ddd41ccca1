"""Runs in, one HTML file out: text, style, scripts and numbers in it, nothing fetched."""

from __future__ import annotations

import base64
import gzip
import html
import json
import string
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from slip_vic.page.packing import Packer
from slip_vic.page.runs import colours, describe, describe_plots, grid, on_grid, shown_s
from slip_vic.page.scripts import read_static, three, uplot
from slip_vic.run.data import RunData
from slip_vic.run.metrics import summarise, summary_table
from slip_vic.scenarios.parameter_files import write_files

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
"""In the order in which the page runs them: each uses those before it."""


def summaries(runs: Mapping[str, RunData]) -> dict[str, dict[str, Any]]:
    """Return the numbers of every arm whose slip is known, by its label."""
    return {
        f"{label} {arm.name}" if len(run.arms) > 1 else label: summarise(arm)
        for label, run in runs.items()
        for arm in run.arms
        if {"slip", "law", "effort"} <= arm.channels.keys()
    }


def write_page(
    path: Path,
    runs: Mapping[str, RunData],
    *,
    command: str,
    description: str = "",
    ends: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write the page of some runs, given by label; ends: by label why a run did not end well.

    Raises:
        InputError: a file that cannot be written.
    """
    times = grid(max(shown_s(run) for run in runs.values()))
    shown = {label: on_grid(run, times, ends.get(label, "")) for label, run in runs.items()}
    packer = Packer()
    described, missing = [], []
    for (label, run), colour in zip(shown.items(), colours(list(runs)), strict=True):
        made, lacking = describe(label, run, packer, colour)
        described.append(made)
        missing += lacking
    header = {"time": packer.add(times), "runs": described, "plots": describe_plots([*shown.values()], packer)}
    known = [(name, value) for run in runs.values() for name, value in run.facts.items()]
    facts = {"command": command} | {
        name: ", ".join(dict.fromkeys(value for other, value in known if other == name)) for name, _ in known
    }
    rows = [f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in facts.items() if v]
    text = assemble(
        title=facts.get("scenario", "recorded runs"),
        description=description,
        table=_table(summaries(runs)),
        laws="<br>".join(f"<b>{label}</b>: {LAWS[label]}" for label in runs if label in LAWS),
        facts=f"<dl>{''.join(rows)}</dl>",
        notes="".join(f"<p>not drawn: {html.escape(name)}</p>" for name in dict.fromkeys(missing)),
        data=base64.b64encode(gzip.compress(packer.pack(header), mtime=0)).decode(),
        live=False,
    )
    write_files(path.parent, {path.name: text})


LAWS: Final = {
    "classical": "impedance control that follows the path and ignores slip.",
    "vic": "the paper's law: stiffness fades with slip, and the pad follows the object until slip has stopped.",
    "governed": "impedance control on a path that the governor slows down before the object slips.",
    "governed_follow": "the same, and the gripper squeezes as little as the load ahead needs.",
}


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
    return str(summary_table(numbers).to_html(table_id="summary", border=0))
