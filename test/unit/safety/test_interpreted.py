"""Interpreted and compiled: what is read is what runs, to the last bit, in whole cycles with faults."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[3]
KINDS = (
    {
        "slip_estimator": "observer",
        "slip_sensor__dead_band_linear": 2e-3,
        "trajectory__kind": "circle",
        "trajectory__duration_s": 4.0,
    },
    {
        "attitude": "rpy",
        "gains__spin": "bounded",
        "trajectory__kind": "quintic",
        "trajectory__displacement": (0.1, 0.0, 0.05),
    },
    {
        "governor__mode": "time_optimal",
        "trajectory__kind": "waypoints",
        "trajectory__waypoints": (0.1, 0.0, 0.05, 0.0, 0.2, 0.0, 0.2, -0.1, 0.0, 0.3, 0.2, -0.4),
    },
)
CALM = {"safety__load__drop_speed": 1e3, "gains__k_s": 100.0}  # nobody moves the arm


def digests() -> list[str]:
    """Return what the bytes of state and outputs come to after each cycle of a short run with every kind of fault."""
    from slip_core.types import JointSample
    from slip_vic_controller.safety.conditions import Request
    from test.support.made_up import LOAD, MS, POSITION, SLIP, MadeUp, N

    found = []
    for kind in KINDS:
        made_up, rng, digest, modes = MadeUp(**kind, **CALM), np.random.default_rng(1), hashlib.sha256(), set()
        for k in range(160):
            q = POSITION + 0.02 * np.sin(0.05 * k + np.arange(N))
            qd = np.cos(0.05 * k + np.arange(N))
            wrench, slip = LOAD + 0.1 * rng.normal(size=6), SLIP * rng.normal(size=6)
            if 20 <= k < 24:
                q = q + np.nan  # bridged
            if 40 <= k < 47:
                q = q + 0.3  # a jump, and a source that starts anew
            if 55 <= k < 65:
                slip[:3] = 0.0  # below the dead band
            if 70 <= k < 80:
                slip = slip + np.nan
            if k == 90:
                wrench[0] = 1e6
            if k == 150:
                made_up.session.set_publishers({}, 2)
            if k in (100, 102, 110):
                made_up.session.request({100: Request.HOLD, 102: Request.ENABLE, 110: Request.HOLD}[k])
            passed_ns = MS if k != 130 else 70 * MS  # the controller did not run
            sample = JointSample(made_up.stamp_ns, q, qd, 0.1 * np.ones(N))
            result = made_up.cycle(sample, wrench, slip if k % 3 == 0 else None, passed_ns)
            modes.add(result.mode.name)
            digest.update(made_up.session.buffer.tobytes() + result.outputs.tobytes())
            digest.update(np.array(list(result.scalars().values())).tobytes())
        made_up.now_ns += 60 * MS
        silent = made_up.session.watchdog(made_up.now_ns)
        digest.update(made_up.session.buffer.tobytes() + silent.outputs.tobytes())
        found.append(f"{'/'.join(sorted(modes))}:{digest.hexdigest()[:24]}")
    return found


def test_interpreted_and_compiled_give_equal_bits() -> None:
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    package = f"package = types.ModuleType('test'); package.__path__ = [{str(ROOT / 'test')!r}]; "
    package += "sys.modules['test'] = package; "  # the standard library has a package of this name too
    code = f"import sys, types, runpy; {package}print(*runpy.run_path({__file__!r})['digests']())"
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, cwd=ROOT)
    compiled = digests()
    assert run.stdout.split() == compiled, run.stderr
    modes = [digest.partition(":")[0] for digest in compiled]
    assert all({"ACTIVE", "DEGRADED", "HOLD", "FAULT"} <= set(each.split("/")) for each in modes), modes
