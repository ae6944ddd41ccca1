"""What calls of services may cost a node: the size of a request, and the processor time that calls take together.

rclpy turns a whole request into Python objects before it calls back, which takes seconds for some megabytes, and the
control cycle waits for it. So the size is read from the C message, before that. Beyond a limit the caller is refused
at once and gets the reason where the response has a place for it; the node's log says so once a second.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import Any, Final

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.service import Service

MOST_ITEMS: Final = 256  # parameters or names in a request; the controller declares some 170
MOST_BYTES: Final = 1 << 16
BURST_S, SHARE = 0.05, 0.25
"""Processor time that calls about parameters may take at once [s], and of all time in the long run."""
TRANSITIONS, TRANSITIONS_PER_S = 10.0, 5.0
"""Transitions that may come at once, and in the long run [1/s]."""
CALM: Final = 10
STORM_S: Final = 5.0
"""More calls for transitions than `CALM` within this time [s] are a storm: none of them may end the process."""
SHUTDOWNS: Final = (
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
    Transition.TRANSITION_INACTIVE_SHUTDOWN,
    Transition.TRANSITION_ACTIVE_SHUTDOWN,
)


class _Sequence(ctypes.Structure):
    """A string or a sequence of rosidl's C messages."""

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


class _Parameter(ctypes.Structure):
    """rcl_interfaces/msg/Parameter with its value."""

    _fields_ = (
        ("name", _Sequence), ("type", ctypes.c_uint8), ("bool_value", ctypes.c_bool),
        ("integer_value", ctypes.c_int64), ("double_value", ctypes.c_double), ("string_value", _Sequence),
        ("bytes", _Sequence), ("bools", _Sequence), ("integers", _Sequence), ("doubles", _Sequence),
        ("strings", _Sequence),
    )  # fmt: skip


class _ChangeState(ctypes.Structure):
    _fields_ = (("id", ctypes.c_uint8), ("label", _Sequence))


Answer = Callable[[Any, Any], Any]
"""Callback of a service: request and response to answer it in."""
_WIDTHS: Final = (("name", 1), ("string_value", 1), ("bytes", 1), ("bools", 1), ("integers", 8), ("doubles", 8))


def _texts_bytes(texts: _Sequence) -> int:
    if texts.size > MOST_ITEMS:
        return MOST_BYTES + 1
    return sum(text.size for text in (_Sequence * texts.size).from_address(texts.data or 0)) if texts.size else 0


def _names_bytes(address: int) -> int:
    return _texts_bytes(_Sequence.from_address(address))


def _parameters_bytes(address: int) -> int:
    given = _Sequence.from_address(address)
    if given.size > MOST_ITEMS:
        return MOST_BYTES + 1
    each = (_Parameter * given.size).from_address(given.data) if given.size else ()
    return sum(_texts_bytes(p.strings) + sum(getattr(p, name).size * width for name, width in _WIDTHS) for p in each)


def _transition_bytes(address: int) -> int:
    size: int = _ChangeState.from_address(address).label.size
    return size


_MEASURES: Final[dict[Any, Callable[[int], int]]] = {
    SetParameters: _parameters_bytes,
    SetParametersAtomically: _parameters_bytes,
    GetParameters: _names_bytes,
    GetParameterTypes: _names_bytes,
    DescribeParameters: _names_bytes,
    ListParameters: _names_bytes,
    ChangeState: _transition_bytes,
}
TOO_LARGE: Final = object()
"""What stands for a request that is not turned into Python."""
_Converter = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_capsule = ctypes.pythonapi.PyCapsule_New
_capsule.restype, _capsule.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
_pointer = ctypes.pythonapi.PyCapsule_GetPointer
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_void_p)
_PARTS: Final = ("_CREATE_ROS_MESSAGE", "_DESTROY_ROS_MESSAGE", "_CONVERT_FROM_PY", "_TYPE_SUPPORT")


def bounded(kind: Any) -> type:
    """Return a service type with which rclpy takes requests as with `kind`; large ones become `TOO_LARGE`."""
    kind.Request.__class__.__import_type_support__()
    meta, measure = kind.Request.__class__, _MEASURES[kind]
    convert = _Converter(_pointer(meta._CONVERT_TO_PY, None))

    def take(address: int) -> object:
        try:
            return TOO_LARGE if measure(address) > MOST_BYTES else convert(address)
        except Exception:  # nothing may be raised into C
            return TOO_LARGE

    taker = _Converter(take)
    parts = {name: getattr(meta, name) for name in _PARTS}
    parts |= {"_CONVERT_TO_PY": _capsule(ctypes.cast(taker, ctypes.c_void_p), None, None), "keep": (taker, convert)}
    request = type(f"Bounded{kind.__name__}Request", (), parts)()
    return type(f"Bounded{kind.__name__}", (), {"Request": request, "Response": kind.Response})


class Allowance:
    """What may be used at once, and grows back with time.

    Args:
        burst: the most that there is.
        rate: by how much it grows [1/s].
    """

    def __init__(self, burst: float, rate: float) -> None:
        self._burst, self._rate = burst, rate
        self._left, self._at_s = burst, time.monotonic()

    def left(self, now_s: float) -> float:
        """Return what is left at this steady time."""
        self._left = min(self._burst, self._left + self._rate * (now_s - self._at_s))
        self._at_s = now_s
        return self._left

    def use(self, amount: float) -> None:
        """Take so much of it."""
        self._left -= amount


class ServiceLimits:
    """The limits of one node.

    Args:
        report: takes a line for the log.
    """

    def __init__(self, report: Callable[[str], object]) -> None:
        self._report = report
        self._time = Allowance(BURST_S, SHARE)
        self._transitions = Allowance(TRANSITIONS, TRANSITIONS_PER_S)
        self._asked_s: list[float] = []
        self._refused: dict[str, int] = {}
        self._said_s = -1.0

    def guard(self, service: Service) -> None:
        """Put the limits in front of a service, where it is one that has them."""
        kind, callback, name = service.srv_type, service.callback, service.srv_name.rsplit("/", 1)[-1]
        if kind not in _MEASURES:
            return
        service.srv_type = bounded(kind)
        allowed = self._transition if kind is ChangeState else self._parameters

        def answer(request: object, response: object) -> object:
            if request is TOO_LARGE:
                return self._refuse(name, f"a request may have {MOST_ITEMS} items and {MOST_BYTES} bytes", response)
            return allowed(name, callback, request, response)

        service.callback = answer

    def _transition(self, name: str, callback: Answer, request: Any, response: Any) -> Any:
        now_s = time.monotonic()
        self._asked_s = [*(at for at in self._asked_s[-CALM:] if now_s - at < STORM_S), now_s]
        wanted = request.transition
        ends = wanted.id in SHUTDOWNS or "shutdown" in wanted.label
        if self._transitions.left(now_s) < 1.0 or (ends and len(self._asked_s) > CALM):
            return self._refuse(name, "too many transitions at once; try again later", response)
        self._transitions.use(1.0)
        return callback(request, response)

    def _parameters(self, name: str, callback: Answer, request: Any, response: Any) -> Any:
        """Answer within the time that is left; each parameter of `set_parameters` counts for itself."""
        if not isinstance(request, SetParameters.Request):
            return self._timed(name, callback, request, response)
        for each in request.parameters:
            one = SetParameters.Request(parameters=[each])
            response.results += self._timed(name, callback, one, SetParameters.Response()).results
        return response

    def _timed(self, name: str, callback: Answer, request: Any, response: Any) -> Any:
        if self._time.left(time.monotonic()) <= 0.0:
            return self._refuse(name, "too many calls at once; try again later", response)
        began_s = time.thread_time()
        try:
            return callback(request, response)
        finally:
            self._time.use(time.thread_time() - began_s)

    def _refuse(self, name: str, reason: str, response: Any) -> object:
        self._refused[name] = self._refused.get(name, 0) + 1
        now_s = time.monotonic()
        if now_s - self._said_s > 1.0:
            self._said_s = now_s
            counts = ", ".join(f"{number} x {service}" for service, number in self._refused.items())
            self._report(f"calls of services refused ({counts}): {reason}")
            self._refused.clear()
        result = SetParametersResult(successful=False, reason=f"refused: {reason}")
        if hasattr(response, "results"):
            response.results = [result]
        elif isinstance(getattr(response, "result", None), SetParametersResult):
            response.result = result
        elif hasattr(response, "success"):
            response.success = False
        return response
