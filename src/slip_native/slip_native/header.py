"""The C headers: a struct per record with its units, an enum per vocabulary, the functions; and the words of both."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import Any, get_args, get_origin, get_type_hints

from slip_core.params import parameter_infos, range_of
from slip_core.records import WHOLE, Record, Records, dtype_of
from slip_native.functions import FUNCTIONS
from slip_vic_controller.contact.observer import Row
from slip_vic_controller.law.symbols import SYMBOLS, Symbols
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.goals import GoalPhase, Refusal
from slip_vic_controller.safety.conditions import REASONS, Missing, Mode, Reason, Request
from slip_vic_controller.session.words import MISSING, MISTAKES, SENSORS
from slip_vic_controller.state import GOVERNED, ArmState, ControllerConfig, CycleInputs, CycleOutputs, TaskState

RECORDS = (ControllerConfig, TaskState, ArmState, Row, CycleInputs, CycleOutputs, Symbols)
ENUMS: tuple[type[IntEnum], ...] = (Mode, Request, Missing, Reason, GoalPhase, Refusal)
C_TYPES = {"In": "const void *", "Out": "void *", "int": "int64_t ", "float": "double ", "None": "void "}
"""Of annotations; pointers without a type, because a buffer holds one record or several."""

TOP = """\
/* The control cycle of slip_vic: records and functions. Made by `slip-vic export`; do not edit.
 *
 * Every function returns in bounded time, allocates nothing, waits for nothing and keeps nothing: the state is the
 * caller's, and arms in different threads need a state each. Whatever the inputs are, commands are finite and within
 * limits. Records are aligned to 8 bytes; positions, forces and angles are in SI units, frames as in docs/concepts.md.
 */
#ifndef SLIP_VIC_H
#define SLIP_VIC_H

#include <assert.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif
"""
BOTTOM = """\
/* Return how often compiled code has met what must not be: an exception, or no room for a temporary array. Always 0. */
int64_t slip_vic_faults(void);

/* Return how many of the 65,536 bytes for temporary arrays the calling thread has used at most. */
int64_t slip_vic_room_used(void);

#ifdef __cplusplus
}
#endif
#endif
"""


def header() -> str:
    """Return the text of slip_vic.h."""
    parts = [TOP, *map(_enum, ENUMS)]
    known: dict[type[Record], None] = {}
    for declared in RECORDS:
        _collect(declared, known)
    parts += [_struct(declared) for declared in known]
    parts += [_prototype(function) for function in FUNCTIONS]
    return "\n".join([*parts, BOTTOM])


def words() -> str:
    """Return the text of slip_vic_words.h: why the controller does what it does, and the names of its numbers."""
    reasons = {reason.value: reason for reason in Reason}
    rows = [reasons.get(number, Reason.NONE) for number in range(REASONS)]
    lists = {
        "reason_words": [row.words for row in rows],
        "reason_names": [row.name for row in rows],
        "mode_names": [mode.name for mode in Mode],
        "missing_words": MISSING,
        "mistake_words": MISTAKES,
        "sensor_words": SENSORS,
        "symbol_names": SYMBOLS.names or (),
        "governed_names": GOVERNED.names or (),
    }
    sizes = [kind.itemsize // 8 for kind, *_ in (SYMBOLS.fields or {}).values()]
    of_symbols = f"static const int slip_vic_symbol_sizes[] = {{{', '.join(map(str, sizes))}}};"
    top = "/* Words of slip_vic.h's numbers, by number. Made by `slip-vic export`; do not edit. */\n#pragma once\n"
    of_lists = (_words(f"slip_vic_{name}", texts) for name, texts in lists.items())
    return "\n".join([top, *of_lists, of_symbols, *_parameters(), ""])


def _parameters() -> Iterator[str]:
    """Yield the table of the controller's parameters; the range of a list is that of each number in it."""
    fields = "const char *name, *description, *unit, *constraint; int live; double least, most;"
    yield f"static const struct {{ {fields} }} slip_vic_parameters[] = {{"
    for info in parameter_infos(ControllerParams):
        bounds, (least, most) = info.bounds, range_of(info.unit)
        if info.kind in (int, float):
            least, most = bounds["ge"], bounds.get("le", bounds.get("lt", 2**62))
        choice = f"one of {', '.join(map(str, bounds['one_of']))}" if "one_of" in bounds else ""
        text = f"{info.description} [{info.unit}]" if info.unit else info.description
        words = ", ".join(map(json.dumps, (info.name, text, info.unit, choice)))
        yield f"    {{{words}, {info.runtime:d}, {least:.17g}, {most:.17g}}},"
    yield "};"


def _words(name: str, texts: Sequence[str]) -> str:
    return "\n".join([f"static const char *const {name}[] = {{", *(f"    {json.dumps(text)}," for text in texts), "};"])


def _collect(declared: type[Record], known: dict[type[Record], None]) -> None:
    """Add a record behind those that it is made of."""
    for hint in get_type_hints(declared, include_extras=True).values():
        inner = _record_of(hint)
        if inner is not None:
            _collect(inner, known)
    known[declared] = None


def _record_of(hint: Any) -> type[Record] | None:
    """Return the record that a field is, or is an array of."""
    kind = get_args(hint)[0] if get_args(hint) else hint
    kind = get_args(kind)[0] if get_origin(kind) is Records else kind
    return kind if isinstance(kind, type) and issubclass(kind, Record) else None


def _enum(names: type[IntEnum]) -> str:
    prefix = f"SLIP_VIC_{names.__name__.upper()}_"
    items = [f"  {prefix}{item.name} = {item.value}," for item in names]
    return "\n".join(
        [*_comment(names), f"typedef enum SlipVic_{names.__name__} {{", *items, f"}} SlipVic_{names.__name__};", ""]
    )


def _struct(declared: type[Record]) -> str:
    name, remarks = f"SlipVic_{declared.__name__}", dict(_FIELD.findall(inspect.getsource(declared)))
    fields = [
        _field(field, hint, remarks.get(field, "").replace("*/", ""))
        for field, hint in get_type_hints(declared, include_extras=True).items()
    ]
    size = dtype_of(declared).itemsize  # type: ignore[arg-type]  # every class is hashable
    check = f'static_assert(sizeof({name}) == {size}, "layout of {name}");'
    return "\n".join([*_comment(declared), f"typedef struct {name} {{", *fields, f"}} {name};", check, ""])


def _field(name: str, hint: Any, remark: str) -> str:
    inner, given = _record_of(hint), get_args(hint)[1] if get_args(hint) else ()
    shape = given if isinstance(given, tuple) else (given,) if isinstance(given, int) else ()
    whole = given == WHOLE or "int64" in str(hint)
    kind = f"SlipVic_{inner.__name__}" if inner is not None else "int64_t" if whole else "double"
    return f"  {kind} {name}{''.join(f'[{n}]' for n in shape)};" + (f" /* {remark} */" if remark else "")


_FIELD = re.compile(r"^    (\w+): [^#\n]*#\s*(.*)$", re.MULTILINE)


def _comment(of: Any) -> Iterator[str]:
    """Yield the lines of a docstring as a comment."""
    first, *more = inspect.cleandoc(of.__doc__).splitlines()
    yield f"/* {first}" + ("" if more else " */")
    for at, line in enumerate(more):
        yield f" * {line}".rstrip() + (" */" if at == len(more) - 1 else "")


def _prototype(function: Any) -> str:
    found = inspect.signature(function)
    arguments = ", ".join(f"{C_TYPES[p.annotation]}{p.name}" for p in found.parameters.values())
    return "\n".join([*_comment(function), f"{C_TYPES[found.return_annotation]}{function.__name__}({arguments});", ""])
