"""A node whose process is stuck in C code, where no handler of Python runs: while it is imported, or while it runs."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from typing import Any


def get_stuck() -> None:
    """Wait for ever for a lock that this thread holds itself."""
    lock = ctypes.create_string_buffer(64)
    libc = ctypes.CDLL(None)
    for _ in range(2):
        libc.pthread_mutex_lock(lock)


class Stuck:
    """Says that it runs, and gets stuck."""

    def run(self, _should_stop: Callable[[], bool]) -> None:
        """Never return."""
        print("runs", flush=True)
        get_stuck()

    @property
    def publishers(self) -> Iterator[Any]:
        """None."""
        return iter(())

    def destroy_node(self) -> None:
        """Nothing."""


if __name__ == "__main__":
    from slip_msgs_py.node_main import main_of

    sys.exit(main_of("stuck_node", "Stuck", "stuck_node", "Gets stuck."))
elif sys.argv[1:] == ["import"]:
    print("is imported", flush=True)
    get_stuck()
