"""Errors come back from worker processes as what they are."""

import pickle

import pytest

from slip_core.errors import InputError, SlipVicError, UnknownName


@pytest.mark.parametrize(
    "error", [SlipVicError("lost"), InputError("a", got="b", expected="c", fix="d"), UnknownName("law", "vik", ["vic"])]
)
def test_an_error_survives_pickling(error: SlipVicError) -> None:
    found = pickle.loads(pickle.dumps(error))
    assert (type(found), str(found), found.exit_code) == (type(error), str(error), error.exit_code)
