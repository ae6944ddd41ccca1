"""The pages tell the truth: every command they show is understood, every link and every named file is there.

`test/system/repository/test_documented_commands.py` runs the commands.
"""

import ast
import re
from pathlib import Path

import click
import pytest

from slip_vic.cli import cli
from test.campaigns.cli import campaigns
from test.support.pages import OURS, PAGES, ROOT, commands_of


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)[)#]", page.read_text()):
        assert target.startswith("http") or (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_files_exist(page: Path) -> None:
    pattern = r"`((?:src|test|config|docs|bags|tools)/[\w./-]+)`"
    for name in re.findall(pattern, page.read_text()):
        assert (ROOT / name).exists(), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_modules_exist(page: Path) -> None:
    """Also where a page gives only the end of its path, such as `law/gains.py`."""
    known = [
        f"/{path.relative_to(ROOT)}"
        for folder in ("src", "test", "examples", "tools")
        for path in (ROOT / folder).rglob("*.py")
    ]
    for name in re.findall(r"`([\w/]+\.py)`", page.read_text()):
        assert name == "friction/x.py" or any(path.endswith(f"/{name}") for path in known), name


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


def options_of(script: Path) -> tuple[set[str], set[str]]:
    """Return the choices or commands, and the options, of a script with argparse or click, from its source."""
    choices: set[str] = set()
    options: set[str] = set()
    for node in ast.walk(ast.parse(script.read_text())):
        if isinstance(node, ast.FunctionDef):
            made = [ast.unparse(decorator) for decorator in node.decorator_list]
            choices |= {node.name.rstrip("_") for text in made if text.endswith(".command()")}
            choices |= {text.split("'")[1] for text in made if ".command('" in text}
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr not in ("add_argument", "option"):
                continue
            name = ast.literal_eval(node.args[0])
            if name.startswith("--"):
                options.add(name)
            for keyword in node.keywords:
                if keyword.arg == "choices":
                    choices |= set(ast.literal_eval(keyword.value))
    return choices, options


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
    if program == "python" and rest[0].endswith(".py"):
        if not (ROOT / rest[0]).is_file():
            return f"no file {rest[0]}"
        choices, options = options_of(ROOT / rest[0])
        given = {word.partition("=")[0] for word in rest[1:] if word.startswith("--")}
        if given - options or not set(rest[1:2]) <= choices:
            return f"{rest[0]} knows {sorted(choices | options)}"
    missing = [w for w in rest if re.match(r"(src|test|config|docs|bags|tools)/", w) and not (ROOT / w).exists()]
    return f"no file {missing}" if missing else ""


def test_commands_are_understood() -> None:
    commands = {page.name: commands_of(page) for page in PAGES}
    found = {f"{page}: {' '.join(w)}": misunderstood(w) for page, shown in commands.items() for w in shown}
    assert {command: wrong for command, wrong in found.items() if wrong} == {}
    assert len(found) > 35
    assert all(commands[page] for page in ("README.md", "CONTRIBUTING.md", "bags.md", "safety.md", "sensors.md"))


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        ("./run rum", "No such command 'rum'"),
        ("slip-vic bag inspect out/mine", "No such command 'inspect'"),
        ("./run run --speed 2", "No such option"),
        ("./run demo --seed -1", "x>=0"),
        ("./run run --law pid", "'pid' is not one of"),
        ("python tools/reference_bags.py --loud", "knows"),
        ("python tools/reference_bag.py", "no file"),
        ("pytest test/bags/test_nothing.py", "no file"),
    ],
)
def test_wrong_commands_are_seen(command: str, wrong: str) -> None:
    assert wrong in misunderstood(command.split())
