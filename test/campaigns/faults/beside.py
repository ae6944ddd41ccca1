"""The native node's session beside Python's in a trial: same samples, every bit of outputs and state compared."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.params import flatten, parameter_infos
from slip_core.types import CartesianReference, JointSample, PoseGoal, SlipSample, WrenchSample
from slip_vic.scenarios.scenario import Scenario
from slip_vic.setup.export import write_node
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.one_arm import OneArm

NAN = np.int64(0x7FF8 << 48)
LIVE = {info.name for info in parameter_infos(ControllerParams) if info.runtime}
"""Parameters that nodes change while the law runs."""


def compile_more(native: Path) -> None:
    """Compile beside.cpp and floor.cpp with the node of a built export; InputError where it is not built."""
    build, more = native.resolve() / "build", Path(__file__).parents[1] / "native.cmake"
    for command in (f"cmake -DSLIP_VIC_MORE={more} {build}", f"cmake --build {build} --target beside floor"):
        done = subprocess.run(command.split(), capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise InputError(f"{native}", got=done.stderr, expected="a built export", fix="cmake, see docs/native.md")


class BesideNative(OneArm):
    """Python's session with the native one beside it; one at a time.

    A cycle raises AssertionError where its inputs to the law, outputs or state differ, or compiled code has met an
    exception.

    Args:
        controller, scenario: of both.
        native: a built export, after `compile_more`.
    """

    def __init__(self, controller: Controller, scenario: Scenario, native: Path) -> None:
        super().__init__(controller)
        self._library: Any = ctypes.CDLL(str(native / "build" / "beside.so"))
        for name in ("state", "exchange", "config"):
            getattr(self._library, name).restype = ctypes.c_void_p
        self._library.set_parameters.restype = ctypes.c_char_p
        with tempfile.TemporaryDirectory(prefix="slip_vic_beside_") as own:
            write_node(scenario, Path(own))
            self._library.make(own.encode())
        self._change()

    def _call(self, name: str, first: int, now_ns: int, *arrays: Any) -> Any:
        numbers = np.concatenate((*arrays, ()), dtype=float)
        pointer = numbers.ctypes.data_as(ctypes.c_void_p)
        return getattr(self._library, name)(ctypes.c_int64(first), ctypes.c_int64(now_ns), pointer)

    def _change(self) -> None:
        """Take over CONFIG and state: of parameters that no node changes."""
        self._call("change", 0, 0, self.session.config, self.session.buffer)

    def add_joint(self, sample: JointSample, now_ns: int) -> None:
        self.arm.add_joint(sample, now_ns)
        self._call("add_joint", sample.stamp_ns, now_ns, sample.position, sample.velocity, sample.effort)

    def add_wrench(self, contact: int, sample: WrenchSample, now_ns: int) -> None:
        self.arm.add_wrench(contact, sample, now_ns)
        self._call("add_wrench", sample.stamp_ns, now_ns, sample.wrench)

    def add_slip(self, contact: int, sample: SlipSample, now_ns: int) -> None:
        self.arm.add_slip(contact, sample, now_ns)
        self._call("add_slip", sample.stamp_ns, now_ns, sample.twist, (sample.valid,))

    def set_reference(self, reference: CartesianReference) -> None:
        self.session.set_reference(reference)
        parts = reference.position, reference.rotation.ravel(), reference.twist, reference.acceleration
        self._call("set_reference", reference.stamp_ns, 0, *parts)

    def set_goal(self, goal: PoseGoal) -> None:
        self.session.set_goal(goal)
        self._call("set_goal", 0, 0, goal.position, goal.rotation.ravel(), np.zeros(12), (goal.duration_s,))

    def retune(self, params: ControllerParams) -> None:
        now, refusal = flatten(self.tuned), b""
        changed = {name: value for name, value in flatten(params).items() if value != now[name]}
        if not changed:  # for nodes that is no change
            return
        for name in LIVE & changed.keys():
            numbers = np.array(changed[name], dtype=float)
            pointer = numbers.ctypes.data_as(ctypes.c_void_p)
            self._library.give(name.encode(), ctypes.c_int64(numbers.size * numbers.ndim), pointer)
        theirs = self._library.set_parameters()
        try:
            super().retune(params)
        except InputError as error:
            refusal = str(error).encode()
            raise
        finally:
            if changed.keys() - LIVE:
                self._change()
            else:
                assert theirs == refusal, f"native: a change is answered by {theirs!r} alone"

    def cycle(self, now_ns: int) -> CycleResult | None:
        self._call("request", self.arm._request, 0)
        return self._compared(super().cycle(now_ns), self._call("cycle", 0, now_ns))

    def watchdog(self, now_ns: int) -> CycleResult | None:
        self._call("request", self.arm._request, 0)
        return self._compared(super().watchdog(now_ns), self._call("watchdog", 0, now_ns))

    def _compared(self, result: CycleResult | None, answers: int) -> CycleResult | None:
        """Return Python's result, where it is that of the native session."""
        assert answers == (result is not None), f"native: cycle {self.arm.cycles}: one answers alone"
        assert self._library.slip_vic_faults() == 0, "native: compiled code has met an exception"
        self._compare(state=self.session.buffer, config=self.session.config)
        if result is not None:
            self._compare(exchange=np.concatenate((result.inputs, result.outputs)))
        return result

    def _compare(self, **numbers: Array) -> None:
        for name, mine in numbers.items():
            theirs = ctypes.string_at(getattr(self._library, name)(), mine.nbytes)
            same = (_bits(theirs) == _bits(mine.tobytes())).all()
            assert same, f"native: cycle {self.arm.cycles}: {name} differs"


def _bits(numbers: bytes) -> NDArray[np.int64]:
    """Return numbers as whole ones; which sign a NaN has IEEE 754 leaves open, and processors decide."""
    bits = np.frombuffer(numbers, np.int64)
    return np.where(bits & np.iinfo(np.int64).max == NAN, NAN, bits)
