"""YAML of unknown origin as plain values: bounded in depth, and in what its aliases add up to.

PyYAML follows YAML 1.1, where ``yes`` is true and ``1:30`` is 90. What YAML 1.2 has as text is text here too; tags and
a key that stands twice in a mapping are refused.

PyYAML builds values by recursion in C, which ends the process where a text is nested deeply enough; and an alias to a
list of aliases costs nothing until it is walked through.
"""

from __future__ import annotations

import json
import re
from typing import Any, Final

import yaml

DEEPEST: Final = 64
MOST: Final = 20_000_000
"""Characters and values, aliases counted as often as they are used."""
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_LOADER):  # type: ignore[misc]
    """Makes of plain scalars what YAML 1.1 and 1.2 agree on, the rest is text."""

    yaml_implicit_resolvers: Any = {}  # noqa: RUF012 - PyYAML's

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping as PyYAML does, where no key stands in it twice."""
        known = set[tuple[str, str]]()
        for key, _ in node.value:
            name = key.tag, str(key.value)
            if name in known:
                raise yaml.constructor.ConstructorError(
                    problem=f"{key.value} stands twice", problem_mark=key.start_mark
                )
            known.add(name)
        made: dict[Any, Any] = super().construct_mapping(node, deep)
        return made


for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ("~", "n", "N", "")),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?(0|[1-9][0-9]{0,17})|0x[0-9a-fA-F]{1,15}", "-+0123456789"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*)([eE][-+][0-9]+)?|[-+]?\.inf|\.nan", "-+.0123456789"),
    ("merge", "<<", "<"),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"(?:{_pattern})$"), list(_first))


def read_yaml(text: str) -> Any:
    """Return what a YAML text says, as plain values only.

    Raises:
        yaml.YAMLError: not YAML, ambiguous, nested too deeply, or larger than it looks.
    """
    _check(text)
    return yaml.load(text, Loader=_Loader)


def parse_json(text: str) -> Any:
    """Return what a JSON text of unknown origin says.

    Raises:
        ValueError: not JSON, nested too deeply, or with an integer of thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("JSON that is nested too deeply") from None


def _check(text: str) -> None:
    sizes: dict[str, int] = {}
    opened: list[tuple[str | None, int]] = []  # anchor, and the size of what was read before
    size = 0
    for event in yaml.parse(text, Loader=_LOADER):
        if (tag := getattr(event, "tag", None)) not in (None, "!"):
            raise yaml.YAMLError(f"tag {tag}")
        if isinstance(event, yaml.CollectionStartEvent):
            opened.append((event.anchor, size))
            size += 1
            if len(opened) > DEEPEST:
                raise yaml.YAMLError(f"nested more than {DEEPEST} deep")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            sizes[anchor or ""] = size - before
        elif isinstance(event, yaml.ScalarEvent):
            sizes[event.anchor or ""] = 1 + len(event.value)
            size += 1 + len(event.value)
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor in [anchor for anchor, _ in opened]:
                raise yaml.YAMLError(f"alias {event.anchor} contains itself")
            size += sizes.get(event.anchor or "", 0)
        if size > MOST:
            raise yaml.YAMLError(f"aliases that make more than {MOST} characters of it")
