"""What motion and slip show of a fall."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.records import dtype_of, new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.evaluation import EVALUATION
from slip_vic_controller.path.paths import REFERENCE
from slip_vic_controller.safety.motion import (
    FALLS_WITHIN_S,
    DropDetectionConfig,
    ObservedMotion,
    forget,
    observe_motion,
)
from test.support.call import call, left

EQUAL = 1e-12
LINEAR = (1.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class Detection:
    """What runs, with records by name."""

    def __init__(self, axes=LINEAR) -> None:
        layouts = (dtype_of(DropDetectionConfig), dtype_of(ObservedMotion), ARM, EVALUATION, REFERENCE)
        self.buffers = [new(layout) for layout in layouts]
        views = [record(buffer, layout) for buffer, layout in zip(self.buffers, layouts, strict=True)]
        self.config, self.observed, self.arm, self.law, self.reference = views
        self.axes = np.array(axes)
        self.config.down[:], self.config.drop_speed = (0.0, 0.0, -1.0), 0.2
        self.config.error_linear, self.config.error_angular = 0.1, 0.5
        self.observed.path_speed = 1.0
        self.arm.rotation[:] = np.eye(3)

    def observe(self, dt: float):
        config, observed, arm, law, reference = self.buffers
        call(observe_motion, config, self.axes, observed, arm, law, record(reference, REFERENCE), dt)
        return self.observed


def fallen(d: Detection, ticks: int = 100) -> float:
    for _ in range(ticks):
        d.observe(0.001)
    return float(d.observed.fall_speed)


def test_only_downward_slip_is_a_fall() -> None:
    """Pads that hold with their normal force along z of the pad: gravity in the plane of slip, or along its normal."""
    expected = {
        "follows it": 0.3, "left behind": 0.3, "upwards": 0.0, "sideways": 0.0, "held": 0.0, "along the normal": 0.0,
        "as the reference asks": 0.0,
    }  # fmt: skip
    for what, speed in expected.items():
        d = Detection()
        d.config.down[:], d.law.slip_speed = (0.0, -1.0, 0.0), 0.0 if what == "held" else 0.02
        if what == "left behind":  # the pad stands still, and moves up against the object
            d.law.v_s[1] = 0.3
        else:
            d.arm.twist[:3] = {"upwards": (0.0, 0.3, 0.0), "sideways": (0.3, 0.0, 0.0)}.get(what, (0.0, -0.3, 0.0))
        if what == "along the normal":
            d.config.down[:], d.arm.twist[:3] = (0.0, 0.0, -1.0), (0.0, 0.0, -0.3)
        if what == "as the reference asks":
            d.reference.twist[1] = -0.3
        assert fallen(d) == pytest.approx(speed, abs=EQUAL), what


def test_neither_wrench_nor_outlier_is_a_fall() -> None:
    """Of an object lighter than told a wrench says that it accelerates down; it falls no faster than gravity allows."""
    d = Detection()
    d.config.down[:], d.law.slip_speed = (0.0, -1.0, 0.0), 0.02
    d.law.a_o[:3] = d.law.carried[:] = (0.0, -3.0, 0.0)
    assert fallen(d, 5000) == 0.0
    d.law.v_s[1] = 5.0
    assert fallen(d, round(1e3 * FALLS_WITHIN_S)) == pytest.approx(0.2)
    d.law.v_s[1] = 0.0
    assert fallen(d, 1) == 0.0


def test_nothing_of_before_remains() -> None:
    assert left(forget, ObservedMotion) == {"path_speed": 1.0}
