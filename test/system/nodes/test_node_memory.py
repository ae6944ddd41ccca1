"""What a node says of its memory is its own."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from slip_msgs_py.node_main import memory_mib

SAYS = "from slip_msgs_py.node_main import memory_mib; print(memory_mib())"
BLOCK_MIB = 600


def test_it_is_the_program_s_own_and_not_that_of_who_started_it() -> None:
    block = np.ones(BLOCK_MIB * 2**17)
    child = subprocess.run([sys.executable, "-c", SAYS], check=True, capture_output=True, text=True)
    assert float(child.stdout) < BLOCK_MIB
    assert memory_mib() > block.nbytes / 2**20
