"""What a node says of its memory."""

from __future__ import annotations

import numpy as np
import pytest

from slip_msgs_py.node_main import memory_mib


def test_it_grows_by_what_is_written_and_never_shrinks() -> None:
    before = memory_mib()
    block = np.ones(round((before + 50) * 2**17))
    most = memory_mib()
    assert most > before + 50
    del block
    assert memory_mib() == pytest.approx(most, rel=0.01)
