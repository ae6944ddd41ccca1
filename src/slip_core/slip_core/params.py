"""Parameters declared once: pydantic models are the single source of types, ranges and descriptions.

The ROS declaration (`ros_params`), the YAML files in ``config/`` and the reference page are made from them.
A parameter's name is its dotted path in the model (``gains.k_s``); lists are flat, as ROS wants them.
"""

from __future__ import annotations

import functools
import types as _types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from slip_core.errors import InputError, UnknownName
from slip_core.files.plain_yaml import Doubtful, read_yaml
from slip_core.files.resources import read_text

Model = TypeVar("Model", bound="ParameterModel")


_RANGE: Final = (1e-6, 1e6)
_RANGES: Final[Mapping[str, tuple[float, float]]] = _types.MappingProxyType(
    {
        "Hz": (1e-3, 1e5),
        "kg": (1e-6, 100.0),
        "kg m2": (1e-12, 100.0),
        **dict.fromkeys(("m", "rad", "m, rad"), (1e-6, 1e3)),
        **dict.fromkeys(("m/s", "rad/s", "m/s, rad/s"), (1e-9, 1e3)),
        **dict.fromkeys(("N", "N m", "N, N m"), (1e-6, 1e4)),
        **dict.fromkeys(("", "m/s2", "m/s^2", "rad/s^2"), (1e-9, 1e6)),
        "N/m, N m/rad": (1e-6, 1e5),
        **dict.fromkeys(("N m/rad", "N s/m", "N m s/rad", "N s/m, N m s/rad"), (1e-6, 1e7)),
        **dict.fromkeys(("1/s2", "1/s^2"), (1e-6, 1e8)),
        **dict.fromkeys(("N/s", "N m/s"), (1e-3, 1e8)),
        **dict.fromkeys(("N/m", "rad/s^3"), (1e-3, 1e9)),
    }
)


def range_of(unit: str) -> tuple[float, float]:
    """Return the smallest size of what must be above zero and the largest of all in a unit.

    Wider than any arm with its object needs: what lies beyond is a number in another unit, as grams for kilograms. A
    declaration may be narrower.
    """
    return _RANGES.get(unit, _RANGE)


class ParameterModel(BaseModel):
    """Base of all parameter groups: frozen, strict about unknown names, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    AT_RUNTIME: ClassVar[frozenset[str]] = frozenset()
    """Parameters of a shared declaration that this node takes changes of at run time."""

    @model_validator(mode="before")
    @classmethod
    def _no_truth_as_number(cls, values: Any) -> Any:
        """Refuse true and false where numbers belong: pydantic makes 1 and 0 of them."""
        for name in cls.model_fields.keys() & values if isinstance(values, Mapping) else ():
            value = values[name]
            parts = value if isinstance(value, list | tuple) else [value]
            if "bool" not in str(cls.model_fields[name].annotation) and any(isinstance(one, bool) for one in parts):
                raise ValueError(f"{name} {value}: no number")
        return values

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        """Refuse what the bounds of a declaration cannot: numbers in vectors, rates too low to have a period."""
        for name in type(self).model_fields:
            values = getattr(self, name)
            if isinstance(values, tuple) and values and isinstance(values[0], float):
                unit = parameter_unit(type(self), name)
                if max(map(abs, values)) > range_of(unit)[1]:
                    most = f"{range_of(unit)[1]:g} {unit}".rstrip()
                    raise ValueError(f"{name} {list(values)}: no number may be beyond {most}")
            elif (
                isinstance(values, float)
                and 0.0 < values < range_of("Hz")[0]
                and parameter_unit(type(self), name) == "Hz"
            ):
                raise ValueError(f"{name} {values}: 0, or at least {range_of('Hz')[0]:g} Hz")
        return self


def parameter_unit(model: type[ParameterModel], name: str) -> str:
    """Return the unit of a model's own parameter."""
    extra = model.model_fields[name].json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) else ""


def parameter(default: Any, description: str, *, unit: str = "", runtime: bool = False, **bounds: Any) -> Any:
    """Declare one parameter: one declaration for code, ROS, YAML and documentation.

    A number has the range of its unit (`range_of`), where its bounds are not narrower.

    Args:
        default: value where none is given.
        description: what it means, understandable alone.
        unit: SI unit; empty where there is none.
        runtime: whether it may change while the node runs.
        bounds: pydantic's, e.g. ``gt=0.0``.
    """
    if isinstance(default, float):
        smallest, largest = range_of(unit)
        if bounds.get("gt") == 0.0:
            del bounds["gt"]
            bounds["ge"] = smallest
        if "lt" not in bounds:
            bounds.setdefault("le", largest)
        if not {"gt", "ge"} & bounds.keys():
            bounds["ge"] = -largest
    extra: dict[str, Any] = {"unit": unit, "runtime": runtime}
    return Field(default=default, description=description, json_schema_extra=extra, **bounds)


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """One declared parameter, flattened: what the ROS declaration and the reference page need."""

    name: str
    kind: Any
    default: Any
    unit: str
    description: str
    bounds: Mapping[str, Any]
    runtime: bool


def parameter_infos(model: type[ParameterModel], prefix: str = "") -> Iterator[ParameterInfo]:
    """Walk a model in order of declaration and yield every leaf parameter with its dotted name."""
    for key, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, ParameterModel):
            yield from parameter_infos(kind, f"{prefix}{key}.")
            continue
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        bounds: dict[str, Any] = {}
        for rule in field.metadata:
            for name in ("gt", "ge", "lt", "le", "min_length", "max_length"):
                if getattr(rule, name, None) is not None:
                    bounds[name] = getattr(rule, name)
        if typing.get_origin(kind) is typing.Literal:
            bounds["one_of"] = typing.get_args(kind)
        yield ParameterInfo(
            name=f"{prefix}{key}",
            kind=kind,
            default=field.get_default(call_default_factory=True),
            unit=str(extra.get("unit", "")),
            description=field.description or "",
            bounds=_types.MappingProxyType(bounds),
            runtime=key in model.AT_RUNTIME or bool(extra.get("runtime", False)),
        )


@functools.cache
def names_of(model: type[ParameterModel]) -> frozenset[str]:
    """Return the dotted names of a model's parameters."""
    return frozenset(info.name for info in parameter_infos(model))


def flatten(model: ParameterModel) -> dict[str, Any]:
    """Return every leaf value under its dotted name, tuples as lists."""

    flat = flat_names(model.model_dump())
    return {name: list(value) if isinstance(value, tuple) else value for name, value in flat.items()}


def build(model: type[Model], values: Mapping[str, object], origin: str) -> Model:
    """Make a model from dotted or nested names.

    Args:
        model: what to make.
        values: what differs from the defaults.
        origin: where the values come from, for errors.

    Raises:
        InputError: unknown name (with the nearest known), wrong type, or a value out of range.
    """
    flat = flat_names(values)
    known = names_of(model)
    for name in flat:
        if name not in known:
            raise UnknownName("parameter", name, known, where=origin)
    return validate(model, nested_names(flat), origin)


def validate(model: type[Model], nested: Mapping[str, object], origin: str) -> Model:
    """Make a model from nested values.

    Raises:
        InputError: the first thing that is wrong, in one line.
    """
    try:
        return model.model_validate(nested)
    except ValidationError as error:
        # an unknown name first: a missing one is often the same, mistyped
        first = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
        name = ".".join(str(part) for part in first["loc"]) or "values"
        message = first["msg"].removeprefix("Value error, ")
        if first["type"] == "extra_forbidden":
            raise UnknownName("name", name, model.model_fields, where=origin) from None
        if first["type"] == "value_error":
            raise InputError(f"{origin}: parameter {name}", got=message, expected="consistent values") from None
        if first["type"] == "missing" and not isinstance(first["loc"][-1], int):
            raise InputError(f"{origin}: parameter {name}", got="none", expected="a value") from None
        read = first["input"]
        if first["type"] == "missing":  # of a list
            name, message = name.rpartition(".")[0], f"{len(read) + error.error_count()} values"
        where = f"{origin}, line {read.line}" if isinstance(read, Doubtful) else origin
        raise InputError(f"{where}: parameter {name}", got=read, expected=_expected(message)) from None


def _expected(message: str) -> str:
    for lead in ("Input should be ", "Tuple should have ", "List should have "):
        if message.startswith(lead):
            return message.removeprefix(lead).partition(", unable")[0]
    return message


def flat_names(values: Mapping[str, object], prefix: str = "") -> dict[str, Any]:
    """Return nested groups under dotted names; names that are dotted already stay.

    Raises:
        InputError: a name twice, once nested and once dotted.
    """
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f"{prefix}{key}"
        own = flat_names(value, f"{name}.") if isinstance(value, Mapping) else {name: value}
        if twice := flat.keys() & own.keys():
            raise InputError(min(twice), got="two values", expected="one, below a nested or a dotted name")
        flat |= own
    return flat


def nested_names(flat: Mapping[str, object]) -> dict[str, Any]:
    """Return dotted names as nested groups: the inverse of `flat_names`."""
    nested: dict[str, Any] = {}
    for name, value in flat.items():
        *groups, leaf = name.split(".")
        node = nested
        for group in groups:
            node = node.setdefault(group, {})
        node[leaf] = value
    return nested


def parse_assignment(text: str) -> tuple[str, Any]:
    """Split ``key=value`` as given to ``--set``; the value is read as YAML.

    Raises:
        InputError: where there is no ``=`` or the value is not YAML.
    """
    key, sign, value = text.partition("=")
    if not sign or not key.strip():
        raise InputError("--set", got=text, expected="key=value, e.g. controller.gains.k_s=500")
    try:
        read = read_yaml(value)
    except (yaml.YAMLError, UnicodeError):
        raise InputError(f"--set {key}", got=value, expected="a YAML value: a number, a word, or [a, b, c]") from None
    return key.strip(), str(read) if isinstance(read, Doubtful) else read  # there are no lines


Assignments = str | Iterable[str] | Mapping[str, Any]
"""Values of parameters by dotted name: a text ``key=value`` or several, or a mapping."""


def parse_assignments(given: Assignments) -> list[tuple[str, Any]]:
    """Return names and values of assignments.

    Raises:
        InputError: see `parse_assignment`.
    """
    if isinstance(given, Mapping):
        return [*given.items()]
    return [parse_assignment(str(text)) for text in ([given] if isinstance(given, str) else given)]


def load_yaml(path: Path) -> dict[str, Any]:
    """Read one YAML mapping.

    Raises:
        InputError: where the file is missing, not YAML or not a mapping.
    """
    return parse_mapping(read_text(str(path), f"file {path}"), f"file {path}")


def parse_mapping(text: str, origin: str) -> dict[str, Any]:
    """Return the YAML mapping that a text is.

    Raises:
        InputError: where it is not YAML or not a mapping, or has a name twice.
    """
    try:
        content = read_yaml(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{origin}, line {mark.line + 1}" if mark else origin
        got = str(getattr(error, "problem", None) or error).replace("did not find expected", "no")
        got = got.replace("found character that cannot start any token", "a tab, or text that needs quotes")
        raise InputError(where, got=got, expected="valid YAML") from None
    if not isinstance(content, dict):
        raise InputError(origin, got=text.strip()[:40] or "nothing", expected="a YAML mapping of names to values")
    flat_names(content, f"{origin}: ")  # refuses a name twice
    return content
