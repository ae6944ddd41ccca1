"""Whatever a file contains: a clear error or correct messages, never anything else."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slip_bags.reader import Bag
from slip_bags.recover import recover
from slip_core.errors import InputError
from test.support.bag_maker import make_bag

TOPICS = {"/a": "std_msgs/msg/String", "/b": "geometry_msgs/msg/WrenchStamped"}
EXAMPLES = 60
SETTINGS = settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
POSITION = st.floats(0.0, 1.0, exclude_max=True)
NUMBERS = [number.to_bytes(8, "little") for number in (0, 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)]
MUTATION = st.tuples(
    POSITION, st.none() | st.integers(0, 64) | st.just(1 << 30), st.binary(max_size=16) | st.sampled_from(NUMBERS)
)
"""A place, how many bytes are left out there (None: as many as are put in), and bytes that are put in."""


class Sample:
    """A whole file; hypothesis prints arguments of failures, this one shortly."""

    def __init__(self, data: bytes) -> None:
        self.data = data


def mutate(data: bytes, mutations: list) -> bytes:
    content = bytearray(data)
    for place, left_out, put in mutations:
        at = int(place * len(content))
        content[at : at + (len(put) if left_out is None else left_out)] = put
    return bytes(content)


@pytest.fixture(scope="module")
def sample(tmp_path_factory) -> Sample:
    folder = tmp_path_factory.mktemp("fuzz") / "bag"
    make_bag(folder, count=30, topics=TOPICS, custom_data={"a": "b"}, attachments={"x.yaml": b"a: 1"}, flush_every=10)
    return Sample((folder / "bag_0.mcap").read_bytes())


def refused(action: Callable[..., object], *arguments: object) -> InputError | None:
    """Run something; return the error it ends with, None where it succeeds. Any other exception passes."""
    try:
        action(*arguments)
    except InputError as error:
        return error
    return None


def use(path: Path) -> None:
    """Everything a reader does."""
    bag = Bag(path)
    for topic in bag.topics:
        bag.series(topic)
        list(bag.messages(topic))


@SETTINGS
@given(mutations=st.lists(MUTATION, min_size=1, max_size=4))
def test_reading_damaged_files(sample, mutations):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        path.write_bytes(mutate(sample.data, mutations))
        error = refused(use, path)
        assert "\n" not in str(error)


@SETTINGS
@given(mutations=st.lists(MUTATION, min_size=1, max_size=4))
def test_recovering_damaged_files(sample, mutations):
    """What is recovered is a whole bag."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "x.mcap", Path(folder) / "out"
        data = mutate(sample.data, mutations)
        path.write_bytes(data)
        error = refused(recover, path, out)
        assert "\n" not in str(error)
        assert path.read_bytes() == data
        assert out.exists() == (error is None)
        if error is None:
            bag = Bag(out)
            assert len(list(bag.raw())) == bag.message_count
