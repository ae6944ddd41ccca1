"""The bits of the law and of its parts on random cases, for the comparison of interpreted and compiled."""

from __future__ import annotations

import hashlib

import numpy as np

from slip_core.params import build
from slip_core.records import new, record
from slip_vic_controller.law.bounds import held_sample_limit
from slip_vic_controller.law.gains import LAW_GAINS, RAMP, fill_ramp, gains_at, make_law_gains
from slip_vic_controller.params.controller_params import ControllerParams, TrajectoryParams
from slip_vic_controller.path.paths import make_path
from test.support.call import call
from test.support.law_cases import PI, random_case, reference_of


def digests() -> list[str]:
    """Return what the bytes of each result come to: law and symbols, observer's motion, slip, ramp, references."""
    found = {name: hashlib.sha256() for name in ("law", "symbols", "motion", "slips", "ramp", "reference", "limit")}
    for seed in range(24):
        case = random_case(
            seed, joints=3 + seed % 5, contacts=1 + seed % 3, attitude=seed % 2, angle=(None, PI - 0.1, 0.0)[seed % 3],
            observed=seed % 4 == 0, spin_limit=(np.inf, 1.0)[seed % 2], length=(1.0, 0.03)[seed % 2],
        )  # fmt: skip
        case.move_slips(0.001)
        found["slips"].update(case.buffers[4].tobytes())
        found["law"].update(case.evaluate().tobytes())
        found["symbols"].update(np.array(list(case.symbols().values())).tobytes())
        found["motion"].update(case.motion(case.v_s)[1].tobytes())
    stiff = {"gains.stiffness": (20.0,) * 6, "gains.damping": (5.0,) * 6, "object.mass": 0.8}
    start, target = (make_law_gains(build(ControllerParams, values, "test"), 900.0) for values in ({}, stiff))
    ramp = new(RAMP)
    call(fill_ramp, ramp, start, target, 0, 200_000_000)
    for share in (0.0, 0.1, 0.37, 0.9, 1.0):
        now = new(LAW_GAINS)
        call(gains_at, ramp, round(share * record(ramp, RAMP).duration_ns), now)
        found["ramp"].update(now.tobytes())
    for values in (
        {"kind": "hold"},
        {"kind": "quintic", "displacement": (0.4, 0.3, -0.1), "rotation": (0.2, -0.5, 0.8)},
        {"kind": "waypoints", "waypoints": (0.1, 0.0, 0.05, 0.0, 0.2, 0.0, 0.2, -0.1, 0.0, 0.3, 0.2, -0.4)},
        {"kind": "circle", "duration_s": 6.0, "rotation": (0.0, 0.1, 0.4)},
        {"kind": "lemniscate", "duration_s": 6.0, "plane": "zx"},
    ):
        path = make_path(build(TrajectoryParams, values, "test"))
        for t in np.linspace(-0.1, 6.1, 23):
            found["reference"].update(reference_of(path, t, np.array([0.5, -0.2, 0.3]), np.eye(3)).tobytes())
    limits = [held_sample_limit(held, delay) for held in (1, 2, 9, 17) for delay in range(12)]
    found["limit"].update(np.array(limits).tobytes())
    return [f"{name}:{digest.hexdigest()[:16]}" for name, digest in found.items()]
