"""The native node's session beside Python's in a trial: same samples, every bit of outputs and state compared."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from slip_core.errors import InputError
from slip_core.types import CartesianReference, JointSample, PoseGoal, SlipSample, WrenchSample
from slip_vic.scenarios.scenario import Scenario
from slip_vic.setup.export import write_node
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.one_arm import OneArm


def compile_beside(native: Path) -> None:
    """Compile what trials call of a built export; InputError where it is not built."""
    build = native.resolve() / "build"
    command = [
        "c++", "-std=c++17", "-O2", "-shared", "-fPIC", f"-I{native}", f"-I{native}/node", f"-L{build}",
        Path(__file__).with_suffix(".cpp"), "-lslip_vic_session", f"-Wl,-rpath,{build}", "-o", build / "beside.so",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{native}", got=done.stderr, expected="a built export", fix="cmake, see docs/native.md")


class BesideNative(OneArm):
    """Python's session with the native one beside it; one at a time.

    A cycle raises AssertionError where its inputs to the law, outputs or state differ, or compiled code has met an
    exception.

    Args:
        controller, scenario: of both.
        native: a built export, after `compile_beside`.
    """

    def __init__(self, controller: Controller, scenario: Scenario, native: Path) -> None:
        super().__init__(controller)
        self._library: Any = ctypes.CDLL(str(native / "build" / "beside.so"))
        self._library.state.restype = self._library.exchange.restype = ctypes.c_void_p
        with tempfile.TemporaryDirectory(prefix="slip_vic_beside_") as own:
            write_node(scenario, Path(own))
            self._library.make(own.encode())
        self._change()

    def _call(self, name: str, first: int, now_ns: int, *arrays: Any) -> Any:
        numbers = np.concatenate((*arrays, ()), dtype=float)
        pointer = numbers.ctypes.data_as(ctypes.c_void_p)
        return getattr(self._library, name)(ctypes.c_int64(first), ctypes.c_int64(now_ns), pointer)

    def _change(self) -> None:
        """Take over CONFIG and state: the native node has no parameters that change, and no noise of a tare."""
        self._config = self.session.config
        self._call("change", 0, 0, self._config, self.session.buffer)

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
        super().retune(params)
        self._change()

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
        given = {"state": self.session.buffer}
        if result is not None:
            given["exchange"] = np.concatenate((result.inputs, result.outputs))
        for name, mine in given.items():
            theirs = ctypes.string_at(getattr(self._library, name)(), mine.nbytes)
            assert theirs == mine.tobytes(), f"native: cycle {self.arm.cycles}: {name} differs"
        if self.session.config is not self._config:
            self._change()
        return result
