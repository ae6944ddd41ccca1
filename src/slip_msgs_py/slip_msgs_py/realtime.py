"""What a node sets in its own process for steady ticks, once everything long-lived has been made."""

from __future__ import annotations

import ctypes
import gc
import resource
import sys
from typing import Final

_PR_SET_TIMERSLACK: Final = 29
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_SWITCH_INTERVAL_S: Final = 1e-4  # a busy Python thread otherwise keeps the interpreter for 5 ms


def set_up_process() -> None:
    """Sharpen this thread's timers, shorten other threads' turns, and take all objects made so far out of gc's sight.

    A full collection takes 14 ms with these libraries loaded. Memory is locked where its limit is unlimited: with any
    other limit a later allocation would fail.
    """
    libc = ctypes.CDLL(None)
    libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY:
        libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT)
