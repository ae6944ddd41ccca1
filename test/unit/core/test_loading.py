"""Modules are loaded without the garbage collector, which is then as it was, whatever happens."""

import gc
import importlib

import pytest

from slip_core.loading import without_collector


@pytest.mark.parametrize("collects", [True, False])
def test_it_is_off_inside_and_as_before_afterwards(collects: bool) -> None:
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        with without_collector():
            assert not gc.isenabled()
        assert gc.isenabled() == collects
        with pytest.raises(ImportError), without_collector():
            importlib.import_module("slip_core.no_such_module")
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
