"""Export topics to CSV, Parquet and pandas, one table per topic, one column per number; or to a bag with `/tf`."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_bags.transforms import Transforms, tf_topic
from slip_bags.writer import BagWriter, WriterOptions
from slip_core.errors import InputError
from slip_msgs_py.messages.transforms import TOPIC

FileFormat = Literal["csv", "parquet"]


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
        parts = field.rpartition(".")
        labels = names if names is not None and len(names) == values.shape[1] and field != "name" else None
        for index in range(values.shape[1]):
            label = f"{field}.{labels[index]}" if labels is not None else f"{parts[0]}{parts[1]}{parts[2]}[{index}]"
            columns[label] = values[:, index]
    return pd.DataFrame(columns)


def export(bag: Bag, topics: Sequence[str], folder: Path, file_format: FileFormat) -> list[tuple[Path, int]]:
    """Write one file per topic into a new folder; returns each file with its number of rows.

    Raises:
        InputError: the folder exists or cannot be written, no such topic, data that cannot be decoded.
    """
    names = [bag.topic(topic).name for topic in topics] or list(bag.topics)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise InputError(f"output {folder}", got=error, expected="a new folder", fix="choose another --out") from None
    written = []
    for name in names:
        table = dataframe(bag, name)
        path = folder / f"{file_name(name)}.{file_format}"
        temporary = path.with_suffix(".tmp")
        try:
            if file_format == "csv":
                table.to_csv(temporary, index=False)
            else:
                table.to_parquet(temporary, index=False)
            temporary.replace(path)
        except OSError as error:
            raise InputError(f"output {path}", got=str(error), expected="a file that can be written") from None
        finally:
            temporary.unlink(missing_ok=True)
        written.append((path, len(table)))
    return written


def export_bag(bag: Bag, topics: Sequence[str], folder: Path) -> int:
    """Write the messages into a new bag, and `/tf` made of them; returns the number of messages made.

    A `/tf` that the bag has is left out for the one that is made. URDFs are taken from topics, else from attachments.

    Raises:
        InputError: the folder exists, no such topic, damaged data, a description that is no URDF.
    """
    infos = [bag.topic(name) for name in topics] or list(bag.topics.values())
    kept = {info.name: info for info in infos if info.name != TOPIC and info.message_count}
    urdfs = {
        "" if name == "arm.urdf" else name.removesuffix(".urdf"): data.decode("utf-8")
        for name, data in bag.attachments.items()
        if name.endswith(".urdf")
    }
    transforms = Transforms({name: info.type_name for name, info in kept.items()}, urdfs=urdfs)
    made = 0
    writer = BagWriter(folder, WriterOptions(custom_data=bag.custom_data, attachments=bag.attachments))
    try:
        for info in kept.values():
            writer.add_topic(info, bag.schema_text(info.name))
        writer.add_topic(*tf_topic())
        for message in bag.raw(kept):
            writer.write(*message)
            for transform in transforms.feed(message):
                writer.write(*transform)
                made += 1
    finally:
        writer.close()
    return made


def file_name(topic: str) -> str:
    """Return a topic's file name: ``/a/b`` becomes ``a.b``."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", topic.strip("/").replace("/", ".")) or "topic"


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
