"""YAML of unknown origin as plain values: bounded in depth, and without aliases, as ROS has it too.

PyYAML follows YAML 1.1, where ``yes`` is true and ``1:30`` is 90. What YAML 1.2 has as text is text here too; tags and
a key that occurs twice in a mapping are refused.

PyYAML builds values by recursion in C, which ends the process where a text is nested deeply enough; and a list of
aliases to lists of aliases is larger than any memory.
"""

from __future__ import annotations

import json
import re
from typing import Any, Final

import yaml

from slip_core.files.resources import MAX_TEXT

DEEPEST: Final = 64
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_LOADER):  # type: ignore[misc]
    """Makes of plain scalars what YAML 1.1 and 1.2 agree on, the rest is text."""

    yaml_implicit_resolvers: Any = {}  # noqa: RUF012 - PyYAML's

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping as PyYAML does, if it has no duplicate key."""
        known = set[tuple[str, str]]()
        for key, _ in node.value:
            name = key.tag, str(key.value)
            if name in known:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key {key.value} twice", problem_mark=key.start_mark
                )
            known.add(name)
        made: dict[Any, Any] = super().construct_mapping(node, deep)
        return made


for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ("~", "n", "N", "")),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?(0|[1-9][0-9]{0,17})|0x[0-9a-fA-F]{1,15}", "-+0123456789"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*)([eE][-+][0-9]+)?|[-+]?\.inf|\.nan", "-+.0123456789"),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"(?:{_pattern})$"), list(_first))


class Doubtful(str):
    """A plain scalar that only YAML 1.1 reads as a number or a boolean: text with its line."""

    __slots__ = ("line",)
    line: int


def _text(loader: _Loader, node: yaml.ScalarNode) -> str:
    text: str = loader.construct_scalar(node)
    if node.style or not _DOUBTFUL.match(text):  # quoted text is no mistake
        return text
    found = Doubtful(text)
    found.line = node.start_mark.line + 1
    return found


_DOUBTFUL = re.compile(r"[-+.]?[0-9]|(?i:y|yes|n|no|on|off)$")
_Loader.add_constructor("tag:yaml.org,2002:str", _text)
yaml.representer.SafeRepresenter.add_representer(Doubtful, lambda dumper, text: dumper.represent_str(str(text)))


def read_yaml(text: str) -> Any:
    """Return the content of a YAML text, as plain values only.

    Raises:
        yaml.YAMLError: not YAML, ambiguous, nested too deeply, or with tags or aliases.
    """
    _check(text)
    return yaml.load(text, Loader=_Loader)


def parse_json(text: str) -> Any:
    """Return the content of a JSON text of unknown origin.

    Raises:
        ValueError: not JSON, nested too deeply, or with an integer of thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("JSON that is nested too deeply") from None


def _check(text: str) -> None:
    if len(text) > MAX_TEXT // 16:  # a node takes more than two hundred times as much
        raise yaml.YAMLError(f"more than {MAX_TEXT // 16} characters")
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        if (tag := getattr(event, "tag", None)) not in (None, "!"):
            raise yaml.YAMLError(f"tag {tag}")
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError(f"alias {event.anchor}")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise yaml.YAMLError(f"nested more than {DEEPEST} deep")
