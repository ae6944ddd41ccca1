"""The pages tell the truth: every command they show is understood, every link and every named file is there.

`test/system/repository/test_documented_commands.py` runs the commands.
"""

import re
from pathlib import Path
from typing import Any

import click
import pytest

from slip_vic.cli import cli
from slip_vic.experiments.law import KNOWN
from slip_vic.presets import preset_names
from slip_vic.scenarios.scenario import LAWS
from test.campaigns.cli import campaigns
from test.support.pages import OURS, PAGES, ROOT, commands_of


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_names_lead_to_files(page: Path) -> None:
    """A page may give only the end of a module's path, such as `law/gains.py`."""
    text, folders = page.read_text(), ("src", "test", "examples", "tools")
    links = [one for one in re.findall(r"\]\(([^)#\s]+)[)#]", text) if not one.startswith("http")]
    assert [target for target in links if not (page.parent / target).exists()] == []
    files = re.findall(r"`((?:src|test|config|docs|bags|tools)/[\w./-]+)`", text)
    assert [name for name in files if not (ROOT / name).exists()] == []
    known = [f"/{path.relative_to(ROOT)}" for folder in folders for path in (ROOT / folder).rglob("*.py")]
    modules = set(re.findall(r"`([\w/]+\.py)`", text)) - {"friction/x.py"}
    assert [name for name in modules if not any(path.endswith(f"/{name}") for path in known)] == []


def test_first_commands_of_the_readme() -> None:
    first = re.search(r"```bash\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.S)
    assert first
    assert [line.split()[:2] for line in first.group(1).splitlines()] == [["./run", "demo"], ["./run", "test"]]


def parse(words: list[str]) -> None:
    """Read a command line of ours as the program does, without running it."""
    if words[:1] == ["test"]:
        return  # pytest's own words
    command: click.Command = campaigns if words[:1] and words[0] in campaigns.commands else cli
    context = click.Context(command, info_name="slip-vic")
    while isinstance(command, click.Group):
        _, found, words = command.resolve_command(context, words)
        assert found is not None
        command = found
        if not isinstance(command, click.Group):
            context = command.make_context(command.name, list(words), parent=context)
            if unknown := unknown_names(context.params):
                raise click.UsageError(f"unknown {', '.join(unknown)}")


def unknown_names(params: dict[str, Any]) -> list[str]:
    """Return the names of presets and laws in the options of a command that nothing has."""
    known = {kind: preset_names(f"{kind}s") for kind in ("scenario", "sensor", "drive", "gripper")}
    known["law"] = [*LAWS, *KNOWN]
    given = {kind: params.get(f"{kind}s", (params.get(kind) or "",)) for kind in known}
    return [one for kind, found in given.items() for one in found if one and "." not in one and one not in known[kind]]


def misunderstood(words: list[str]) -> str:
    """Return what is wrong with a command, "" where nothing is."""
    program, *rest = words
    if program in OURS:
        try:
            parse(rest)
        except click.MissingParameter as error:  # a sentence may name a command without its arguments
            return error.format_message() if any(word.startswith("-") for word in rest) else ""
        except click.UsageError as error:
            return error.format_message()
        except click.exceptions.Exit:
            return ""  # --help
        return ""
    if program == "python" and rest[0].endswith(".py") and not (ROOT / rest[0]).is_file():
        return f"no file {rest[0]}"
    missing = [w for w in rest if re.match(r"(src|test|config|docs|bags|tools)/", w) and not (ROOT / w).exists()]
    return f"no file {missing}" if missing else ""


def test_commands_are_understood() -> None:
    commands = {page.name: commands_of(page) for page in PAGES}
    found = {f"{page}: {' '.join(w)}": misunderstood(w) for page, shown in commands.items() for w in shown}
    assert {command: wrong for command, wrong in found.items() if wrong} == {}
    assert len(found) > 35
    assert all(commands[page] for page in ("README.md", "CONTRIBUTING.md", "bags.md", "safety.md", "sensors.md"))
