"""YAML of unknown origin as plain values: bounded in depth, and in what its aliases add up to.

PyYAML builds values by recursion in C, which ends the process where a text is nested deeply enough; and an alias to a
list of aliases costs nothing until it is walked through.
"""

from __future__ import annotations

from typing import Any, Final

import yaml

DEEPEST: Final = 64
MOST: Final = 20_000_000
"""Characters and values, aliases counted as often as they are used."""
_LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def read_yaml(text: str) -> Any:
    """Return what a YAML text says, as plain values only.

    Raises:
        yaml.YAMLError: not YAML, nested too deeply, or larger than it looks.
    """
    _check(text)
    return yaml.load(text, Loader=_LOADER)


def _check(text: str) -> None:
    sizes: dict[str, int] = {}
    opened: list[tuple[str | None, int]] = []  # anchor, and the size of what was read before
    size = 0
    for event in yaml.parse(text, Loader=_LOADER):
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
