"""The bits of a governed path, for the comparison of interpreted and compiled."""

from __future__ import annotations

import hashlib

import numpy as np

from test.referees.governor_bench import PAPER_PLANAR, Governing, Governor
from test.referees.governor_paths import BentPath


def digests() -> list[str]:
    """Return what the buffers come to after a short run with a slip."""
    G = Governor(BentPath([0.2, -0.3, 0.1, 0.2, -0.1, 0.5], 1.0, [0.03] * 6), PAPER_PLANAR, mode=Governing.TIME_OPTIMAL)
    for k in range(60):
        _, R, v, a = G.before()
        G.record_load(np.array([0.1, 0, 0, 0, 0, 0.001 * k]), k * 1_000_000)
        G.slip(k * 1_000_000, 1e-3 * (k == 40))
        G.after(1.1 * a, a, R, v[3:])
    return [hashlib.sha256(b"".join(buffer.tobytes() for buffer in G.buffers)).hexdigest()]
