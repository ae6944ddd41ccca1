"""One topic of a bag as a pandas table, one column per number."""

from __future__ import annotations

from typing import Any

import pandas as pd

from slip_bags.reader import Bag
from slip_bags.series import Series


def dataframe(bag: Bag, topic: str) -> pd.DataFrame:
    """Return one topic as a table: times, sequence and stamp first, then every field.

    An array field becomes one column per element: ``position[0]``, or ``position.<name>`` where the message has
    a constant ``name`` array of the same length, as joint states do. Where a field's length varies, and in arrays of
    messages, its cells are arrays and lists.

    Raises:
        InputError: no such topic, or data that cannot be decoded.
    """
    series = bag.series(topic)
    columns: dict[str, Any] = {
        name: getattr(series, name)
        for name in ("log_time_ns", "publish_time_ns", "sequence", "stamp_ns")
        if getattr(series, name) is not None
    }
    names = _constant_names(series)
    for field, values in series.items():
        if values.ndim == 2:
            labels = names if len(names) == values.shape[1] and field != "name" else None
            for index, column in enumerate(values.T):
                columns[f"{field}.{labels[index]}" if labels else f"{field}[{index}]"] = column
        else:
            columns[field] = values
    return pd.DataFrame(columns)


def _constant_names(series: Series) -> list[str]:
    names = series.get("name")
    if names is None or names.ndim != 2 or not (names == names[0]).all():
        return []
    labels = [str(name) for name in names[0]]
    return labels if len(set(labels)) == len(labels) else []
