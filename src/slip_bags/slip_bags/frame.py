"""One topic of a bag as a pandas table, one column per number."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slip_bags.reader import Bag
from slip_bags.series import Series


def dataframe(bag: Bag, topic: str) -> pd.DataFrame:
    """Return one topic as a table: times, sequence and stamp first, then every field.

    An array field becomes one column per element: ``position[0]``, or ``position.<name>`` where the message has
    a constant ``name`` array of the same length, as joint states do. Where a field's length varies, its cells
    are JSON text.

    Raises:
        InputError: no such topic, or data that cannot be decoded.
    """
    series = bag.series(topic)
    columns: dict[str, Any] = {
        "log_time_ns": series.log_time_ns,
        "publish_time_ns": series.publish_time_ns,
        "sequence": series.sequence,
    }
    if series.stamp_ns is not None:
        columns["stamp_ns"] = series.stamp_ns
    names = _constant_names(series)
    for field, values in series.items():
        if values.ndim == 1:
            columns[field] = _plain(values)
            continue
        is_named = names is not None and len(names) == values.shape[1] and field != "name"
        for index in range(values.shape[1]):
            label = f"{field}.{names[index]}" if is_named and names is not None else f"{field}[{index}]"
            columns[label] = values[:, index]
    return pd.DataFrame(columns)


def _constant_names(series: Series) -> list[str] | None:
    names = series.get("name")
    if names is None or names.ndim != 2 or not len(names) or not (names == names[0]).all():
        return None
    labels = [str(name) for name in names[0]]
    return labels if len(set(labels)) == len(labels) else None


def _plain(values: NDArray[Any]) -> NDArray[Any] | list[str | None]:
    """Keep numbers and texts; turn arrays of varying length into JSON text."""
    if values.dtype != object or all(isinstance(value, str) for value in values):
        return values
    return [_json(value) for value in values]


def _json(value: object) -> str | None:
    if value is None:
        return None
    return json.dumps(value.tolist() if isinstance(value, np.ndarray | np.generic) else value)
