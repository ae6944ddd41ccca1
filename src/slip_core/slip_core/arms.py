"""Parameters of N arms in one node: `arms` lists their names, and each has its parameters below its own.

One arm without a name has its parameters without a prefix, and no `arms`.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any, TypeVar

from pydantic import create_model

from slip_core.errors import InputError
from slip_core.params import ParameterModel, parameter

Model = TypeVar("Model", bound=ParameterModel)

ONE_ARM = ""
"""Name of the only arm: its topics, files and parameters have no prefix."""
_NAME = re.compile(r"[a-z][a-z0-9_]*")


class ParamsOfArms(ParameterModel):
    """Base of the parameters of several arms; `model_of_arms` adds a field for each."""

    arms: tuple[str, ...] = parameter((), "names of the arms that hold the object: prefixes of parameters and topics")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by values: the class is made when it is needed."""
        each = by_arm(self)
        return params_of_arms, (type(each[self.arms[0]]), each)


@functools.cache
def model_of_arms(model: type[ParameterModel], names: tuple[str, ...]) -> type[ParamsOfArms]:
    """Return the model of several arms' parameters: `arms`, and `model` below each name.

    Raises:
        InputError: a name that is no prefix of topics, is there twice, or means something else in a scenario.
    """
    for name in names:
        if not _NAME.fullmatch(name) or name in ("arms", "bridge", "controller") or names.count(name) > 1:
            raise InputError("parameter arms", got=list(names), expected="different names of a-z, 0-9 and _")
    fields: dict[str, Any] = {name: (model, model()) for name in names}
    return create_model("ParamsOfArms", __base__=ParamsOfArms, arms=(tuple[str, ...], names), **fields)


def params_of_arms(model: type[Model], arms: Mapping[str, Model]) -> ParameterModel:
    """Return the parameters of a node with these arms: those of the one arm, or all below their names.

    Raises:
        InputError: as in `model_of_arms`.
    """
    if set(arms) == {ONE_ARM}:
        return arms[ONE_ARM]
    return model_of_arms(model, tuple(arms)).model_validate(dict(arms))


def by_arm(params: ParameterModel) -> dict[str, Any]:
    """Return the parameters of each arm by its name; of a node with one arm {"": params}."""
    if isinstance(params, ParamsOfArms):
        return {name: getattr(params, name) for name in params.arms}
    return {ONE_ARM: params}


def prefix_of(arm: str) -> str:
    """Return the prefix of an arm's topics: `left/`, or none."""
    return f"{arm}/" if arm else ""


def shared(params: Mapping[str, Model], names: Sequence[str], why: str) -> None:
    """Check that parameters have the same values in every arm.

    Args:
        params: by arm.
        names: of the parameters.
        why: there is one of them.

    Raises:
        InputError: two arms differ.
    """
    first, *others = params
    for name in names:
        for other in others:
            if attrgetter(name)(params[other]) != attrgetter(name)(params[first]):
                raise InputError(f"parameter {name}", got=f"different values of {first} and {other}", expected=why)
