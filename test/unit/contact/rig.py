"""The observer with its buffers, and a pad over an object."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import BOOL, IN1, IN2, INT, OUT1, OUT2, VOID, kernel
from slip_core.params import build
from slip_core.records import new, record, records
from slip_vic_controller.config.observer import TUNING, Tuning, capacity, observer_config
from slip_vic_controller.contact.observer import MOTION, OBSERVER, OBSERVER_CONFIG, ROW_SIZE, observe, reset
from slip_vic_controller.law.contact import SLIP_SAMPLE
from slip_vic_controller.params.controller_params import ControllerParams

MS = 1_000_000
PLANE = (True, True, False, False, False, True)
SENSOR = {"slip_sensor__noise_linear": 2e-3, "slip_sensor__noise_angular": 0.05}


def make_params(**values) -> ControllerParams:
    given = {"contacts.slip_axes": PLANE, **{name.replace("__", "."): value for name, value in values.items()}}
    return build(ControllerParams, given, "test")


def given(**values) -> tuple[ControllerParams, Tuning]:
    """Return parameters, and the tuning of the observer: values whose names begin with observer__."""
    tuned = {
        name.removeprefix("observer__"): values.pop(name) for name in list(values) if name.startswith("observer__")
    }
    return make_params(**values), TUNING._replace(**tuned)


def six(x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> np.ndarray:
    return np.array([x, y, 0.0, 0.0, 0.0, turn])


@kernel(VOID, IN1, OUT1, INT, IN1)
def reset_buffers(config: Array, state: Array, stamp_ns: int, v_ee: Array) -> None:
    """`reset` of buffers."""
    reset(record(config, OBSERVER_CONFIG), record(state, OBSERVER), stamp_ns, v_ee)


@kernel(BOOL, IN1, OUT1, OUT2, IN1, INT, IN2, INT)
def observe_buffers(
    config: Array, state: Array, history: Array, motion: Array, stamp_ns: int, samples: Array, count: int
) -> bool:
    """`observe` of buffers; samples: (n, 7)."""
    return observe(
        record(config, OBSERVER_CONFIG), record(state, OBSERVER), history, record(motion, MOTION), stamp_ns,
        records(samples, SLIP_SAMPLE), count,
    )  # fmt: skip


class Observer:
    """The observer that runs, with its buffers.

    Args:
        params, tuning: of the controller and the observer.
        start_ns: stamp of the tick before the first one.
        rows: capacity of the history, where it is not what the parameters ask for.
    """

    def __init__(
        self, params: ControllerParams, tuning: Tuning = TUNING, start_ns: int = 0, rows: int | None = None
    ) -> None:
        self.config_buffer = observer_config(params, tuning)
        self.config = record(self.config_buffer, OBSERVER_CONFIG)
        self.buffer = new(OBSERVER)
        self.state = record(self.buffer, OBSERVER)
        self.history = np.zeros((rows or capacity(params, tuning), ROW_SIZE))
        reset_buffers(self.config_buffer, self.buffer, start_ns, np.zeros(6))

    def observe(self, motion: np.ndarray, stamp_ns: int, samples) -> bool:
        """Take in a tick, a MOTION buffer, and its samples: pairs of stamp and twist (6,)."""
        fresh = np.zeros((len(samples), SLIP_SAMPLE.itemsize // 8))
        ordered = sorted(samples, key=lambda sample: sample[0])  # as the queue has them
        for sample, (sample_ns, twist) in zip(fresh.view(SLIP_SAMPLE)[:, 0], ordered, strict=True):
            sample["stamp_ns"], sample["twist"] = sample_ns, twist
        return self.observe_packed(motion, stamp_ns, fresh)

    def observe_packed(self, motion: np.ndarray, stamp_ns: int, fresh: np.ndarray) -> bool:
        """Take in a tick and its samples, rows of SLIP_SAMPLE."""
        buffers = self.config_buffer, self.buffer, self.history, motion
        return observe_buffers(*buffers, stamp_ns, fresh, len(fresh))

    def copy(self) -> Observer:
        other = object.__new__(Observer)
        other.__dict__ = {**self.__dict__, "buffer": self.buffer.copy(), "history": self.history.copy()}
        other.state = record(other.buffer, OBSERVER)
        return other


def make_motion(v_ee, follow=None, force=None, drag=(0.0, 0.0, 0.0), w_o=(0.0, 0.0, 0.0), R=None) -> np.ndarray:
    buffer = new(MOTION)
    motion = buffer.view(MOTION)[0]  # a record by name is slower in Python
    motion["rotation"] = np.eye(3) if R is None else R
    motion["v_ee"], motion["drag"], motion["w_o"] = v_ee, drag, w_o
    motion["follow"] = 0.0 if follow is None else follow
    motion["force"] = motion["follow"] if force is None else force
    return buffer


class Bench:
    """A pad that accelerates by given steps over an object whose acceleration the wrench reports.

    Args:
        values: as of `given`.
    """

    def __init__(self, **values) -> None:
        self.observer = Observer(*given(**values))
        self.config, self.state = self.observer.config, self.observer.state
        self.twist, self.tick = np.zeros(6), 0

    def step(self, acceleration, follow=None, samples=(), drag=(0.0, 0.0, 0.0)):
        """Do a tick of 1 ms; return the state."""
        self.tick += 1
        self.twist = self.twist + 1e-3 * acceleration
        return self.move(make_motion(self.twist, follow, drag=drag), self.tick * MS, samples)

    def move(self, motion: np.ndarray, stamp_ns: int, samples=()):
        """Do a tick of any motion; return the state."""
        assert self.observer.observe(motion, stamp_ns, samples)
        return self.state
