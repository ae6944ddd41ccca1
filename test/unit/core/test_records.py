"""Declared records: the dtype of a class, views of buffers, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_core.records import (
    Mat3,
    Real,
    Record,
    Records,
    Vec6,
    Whole,
    WholeArray,
    copy_fields,
    dtype_of,
    layout,
    new,
    record,
)


class Part(Record):
    """A nested record."""

    gain: Real
    axes: Annotated[WholeArray, 2]


class Everything(Record):
    """All kinds of fields."""

    count: Whole
    twist: Vec6
    rotation: Mat3
    joints: Annotated[Array, 7]
    part: Part
    parts: Annotated[Records[Part], 3]


class Wrong(Record):
    """A field that is none."""

    name: str


EVERYTHING = dtype_of(Everything)


def test_dtype_is_that_of_the_fields_in_order() -> None:
    part = np.dtype([("gain", "f8"), ("axes", "i8", (2,))])
    expected = [
        ("count", "i8"),
        ("twist", "f8", (6,)),
        ("rotation", "f8", (3, 3)),
        ("joints", "f8", (7,)),
        ("part", part),
        ("parts", part, (3,)),
    ]
    assert np.dtype(expected) == EVERYTHING
    assert EVERYTHING.itemsize == 8 * (1 + 6 + 9 + 7 + 3 + 9)


def test_a_view_writes_through_and_nested_records_are_assigned_whole() -> None:
    buffer = new(EVERYTHING)
    view: Everything = record(buffer, EVERYTHING)
    view.count, view.part.gain, view.part.axes[:] = 3, 0.5, (1, 2)
    view.parts[1] = view.part
    assert buffer.view(np.int64)[0] == 3
    assert view.parts[1].gain == 0.5
    assert view.parts[1].axes.tolist() == [1, 2]
    assert view.parts[0].gain == 0.0


def test_a_misspelt_field_of_a_view_is_an_error_and_not_a_new_attribute() -> None:
    view = record(new(EVERYTHING), EVERYTHING)
    with pytest.raises(AttributeError, match="no field gian"):
        view.part.gian  # noqa: B018
    with pytest.raises(ValueError, match="gian"):
        view.part.gian = 1.0
    assert not hasattr(view, "gian")


def test_what_is_no_field_is_refused() -> None:
    with pytest.raises(TypeError, match=r"Wrong\.name"):
        dtype_of(Wrong)


def test_fields_are_copied_by_name() -> None:
    view = record(new(EVERYTHING), EVERYTHING)
    view.joints[:] = 1.0
    copy_fields(
        view, SimpleNamespace(count=True, twist=(1.0,) * 6), SimpleNamespace(joints=(0.5, 2.0), part="no number")
    )
    assert (view.count, view.twist.tolist()) == (1, [1.0] * 6)
    assert view.joints.tolist() == [0.5, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    timed = record(new(layout([("age_ns", "i8")])), layout([("age_ns", "i8")]))
    copy_fields(timed, SimpleNamespace(age_s=0.15))
    assert timed.age_ns == 150_000_000
