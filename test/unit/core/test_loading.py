"""Modules are loaded without the garbage collector, which is then as it was, whatever happens."""

import gc

import pytest

from slip_core.loading import without_collector


@pytest.mark.parametrize("collects", [True, False])
def test_it_is_off_inside_and_as_before_afterwards(collects: bool) -> None:
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        with pytest.raises(ImportError), without_collector():
            assert not gc.isenabled()
            raise ImportError
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
