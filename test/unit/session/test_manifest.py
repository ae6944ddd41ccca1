"""The bridge's list of the samples that belong to a lockstep cycle, as it is read from its message."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_vic_controller.session.manifest import Manifest


def test_numbers_have_their_places() -> None:
    found = Manifest.decode(0, np.array([7, 3, 5, 11, 12, 21, 22]))
    assert found == Manifest(tick=7, stamp_ns=3_000_000_005, wrench_counts=(11, 21), slip_counts=(12, 22))
    assert Manifest.decode(0, np.array([7, 3, 5, 11, 12])).slip_counts == (12,)


@pytest.mark.parametrize("size", [0, 3, 4, 6, 8])
def test_another_length_is_refused(size: int) -> None:
    with pytest.raises(InputError, match=f"got {size} numbers"):
        Manifest.decode(0, np.arange(size))
