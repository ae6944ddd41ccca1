"""Why the controller is in a mode: codes inside the control cycle, words outside of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum, unique
from typing import NamedTuple

from slip_core.compiled import part
from slip_core.records import Real, Record, Whole
from slip_vic_controller.arm.joint_estimate import Finding
from slip_vic_controller.arm.tare import Sensor
from slip_vic_controller.contact.estimate import Health
from slip_vic_controller.safety.faults import Fault, Input, describe_fault
from slip_vic_controller.sizes import MAX_CONTACTS


@unique
class Cause(IntEnum):
    """What a reason is about; `detail`, `value` and `limit` of a `Reason` say more."""

    NONE = 0
    NO_INPUT_YET = 1
    WAITS = 2  # detail: bits of what is missing
    NOT_ENABLED = 3
    ASKED = 4
    STOPPING = 5
    INPUT = 6  # detail: fault_detail(input, fault)
    PREDICTED = 7  # the same, while the observer runs alone
    SLOWING = 8  # the same, while the path comes to rest
    SLIDES = 9
    JOINT_TOO_FAST = 10  # detail: joint + 256 * what `disturbed` adds; value, limit [rad/s]
    PAD_TOO_FAST = 11  # value, limit [m/s]
    PAD_TURNS_TOO_FAST = 12  # value, limit [rad/s]
    FALLS = 13  # detail: 256 * what `disturbed` adds; value [m/s]
    SATURATED = 14
    PATH_WAITS = 15
    OLD_JOINT_STATE = 16
    BAD_REFERENCE = 17
    NO_ESTIMATE = 18
    NO_TORQUE = 19
    INTERNAL = 20
    PATH_TOO_HEAVY = 21  # value: load of the weight, limit [N]; detail: where, time of the trajectory [ms]
    OVERRUNS = 22
    GIVEN_UP = 23
    ENDLESS_SLIP = 33
    CONTRADICTS = 35  # detail: Health of the slip sensor; value, limit: load that motion needs, that is measured [N]
    MOVED_IN_TARE = 36  # detail: joint; value: motion [rad]
    TOO_HEAVY = 37  # detail: joint; value: torque at rest, limit [N m]
    TARE = 26
    NOT_FOLLOWING = 28  # detail: joint; value: torque on it beyond what it needs at rest [N m], limit: error [m]
    NOT_TURNING = 30  # the same where only the attitude is far: limit: error [rad]
    RANGE_END = 29  # detail: joint; value: its position [rad], limit: error [m]
    RANGE_END_TURNED = 31  # the same where only the attitude is far: limit: error [rad]
    PUSHED_BACK = 32  # detail: joint; value: its position [rad]
    BIASED = 27  # detail: the sensor; value, limit in its unit
    JOINT = 25  # detail: joint + 256 * Finding of the estimator; value, limit [rad], [N m] or [rad/s]


@unique
class Prefix(IntEnum):
    """What is said before a cause; bits."""

    NONE = 0
    ASKED_AND = 1
    RESUMES_AFTER = 2
    AFTER_RESET = 4


_MOUNTED = {
    Health.X_INVERTED: "on x: sign inverted",
    Health.Y_INVERTED: "on y: sign inverted",
    Health.Z_INVERTED: "on z: sign inverted",
    Health.INVERTED: "on all axes: sign inverted",
    Health.XY_SWAPPED: "x and y swapped",
    Health.YZ_SWAPPED: "y and z swapped",
    Health.ZX_SWAPPED: "z and x swapped",
}
LARGEST_SAID = 1e4
"""Largest disturbance that a reason says [N m]."""
ACTIVATION, GOOD_JOINT_STATE, JOINT_STATES = 1, 2, 4
FIRST_WRENCH = 8
"""Bits of what is missing; wrenches of the contacts follow, then their slips."""


class ReasonRecord(Record):
    """A `Reason` in a buffer."""

    cause: Whole  # Cause
    detail: Whole  # see Cause
    prefix: Whole  # bits of Prefix
    value: Real  # unit: see Cause
    limit: Real  # unit: see Cause


class Reason(NamedTuple):
    """Why, as codes."""

    cause: int
    detail: int
    prefix: int
    value: float
    limit: float


@part
def because(cause: int, detail: int) -> Reason:
    """Return a reason without numbers."""
    return Reason(0 + cause, int(detail), 0, 0.0, 0.0)


@part
def of_fault(cause: int, of: int, fault: int) -> Reason:
    """Return the reason that an input has a fault."""
    return Reason(0 + cause, 256 * of + fault, 0, 0.0, 0.0)


@part
def prefixed(reason: Reason, prefix: int) -> Reason:
    """Return a reason with something said before it."""
    return Reason(reason.cause, reason.detail, reason.prefix | prefix, reason.value, reason.limit)


@part
def disturbed(reason: Reason, joint: int, torque: float) -> Reason:
    """Return a reason with the disturbance of a joint [N m] beside it: JOINT_TOO_FAST and FALLS have room for it."""
    detail = 1 + joint + 256 * int(10.0 * min(abs(torque), LARGEST_SAID) + 0.5)
    return Reason(reason.cause, reason.detail + 256 * detail, reason.prefix, reason.value, reason.limit)


@part
def read_reason(r: ReasonRecord) -> Reason:
    """Return the reason in a record."""
    return Reason(r.cause, r.detail, r.prefix, r.value, r.limit)


@part
def put_reason(r: ReasonRecord, reason: Reason) -> None:
    """Write a reason to a record."""
    r.cause, r.detail, r.prefix = reason.cause, reason.detail, reason.prefix
    r.value, r.limit = reason.value, reason.limit


def describe(reason: Reason | ReasonRecord, joint_names: Sequence[str]) -> str:
    """Return the words of a reason; an empty text where there is none."""
    text = _cause_text(reason, joint_names)
    if reason.prefix & Prefix.ASKED_AND:
        text = f"hold requested; {text}"
    if reason.prefix & Prefix.AFTER_RESET:
        text = f"not enabled, after a reset of: {text}"
    return f"resumes after: {text}" if reason.prefix & Prefix.RESUMES_AFTER else text


def missing_words(bits: int) -> list[str]:
    """Return what is missing."""
    names = ["activation"] if bits & ACTIVATION else []
    names += ["a good joint state"] if bits & GOOD_JOINT_STATE else []
    names += ["joint_states"] if bits & JOINT_STATES else []
    for i in range(2 * MAX_CONTACTS):
        if bits & (FIRST_WRENCH << i):
            name = "wrench" if i < MAX_CONTACTS else "slip"
            names.append(f"{name} of contact {i % MAX_CONTACTS}")
    return names


def _cause_text(reason: Reason | ReasonRecord, joint_names: Sequence[str]) -> str:
    cause, value, limit = Cause(reason.cause), reason.value, reason.limit
    if cause == Cause.WAITS:
        return f"waits for {', '.join(missing_words(reason.detail))}"
    if cause in _OF_FAULT:
        of, fault = divmod(reason.detail, 256)
        return describe_fault(Input(of), Fault(fault)) + _OF_FAULT[cause]
    if cause == Cause.JOINT_TOO_FAST:
        joint, more = reason.detail % 256, _disturbance_text(reason.detail // 256, joint_names)
        return f"{joint_names[joint]} turns at {value:.1f} rad/s, the limit is {limit:.1f}{more}"
    if cause in (Cause.PAD_TOO_FAST, Cause.PAD_TURNS_TOO_FAST):
        unit = "m/s" if cause == Cause.PAD_TOO_FAST else "rad/s"
        return f"the pad moves at {value:.1f} {unit}, the limit is {limit:.1f}"
    if cause == Cause.PATH_TOO_HEAVY:
        load = f"holding the weight needs {value:.3f} N, friction can carry {limit:.3f} N"
        return f"friction cannot carry the object where the path is at {1e-3 * reason.detail:.3f} s: {load}"
    if cause == Cause.JOINT:
        finding, joint = divmod(reason.detail, 256)
        return finding_text(Finding(finding), joint_names[joint], value, limit)
    if cause in (*_AWAY, *_TURNED):
        off = f"{1e3 * limit:.0f} mm" if cause in _AWAY else f"{math.degrees(limit):.1f} degrees"
        why = f"does not follow: {value:.2f} N m more than it needs at rest do not move it"
        if cause in (Cause.RANGE_END, Cause.RANGE_END_TURNED):
            why = f"is at the end of its range, at {value:.2f} rad"
        return f"{joint_names[reason.detail]} {why}, and the pad stays {off} off its reference"
    if cause == Cause.PUSHED_BACK:
        why = "is pushed back from the end of its range"
        return f"{joint_names[reason.detail]} {why}, at {value:.2f} rad: the pad cannot keep to the path"
    if cause == Cause.CONTRADICTS and reason.detail == Health.READS_NOTHING:
        return f"the wrench shows {limit:.2f} N where the motion needs {value:.2f} N, and slip_velocity reads nothing"
    if cause == Cause.CONTRADICTS:
        return f"slip_velocity reads against the friction force, {_MOUNTED[Health(reason.detail)]}: it is not used"
    if cause == Cause.MOVED_IN_TARE:
        why = "gravity, load or torque offset are not those of the model: check object.mass and effort.gravity"
        return f"{joint_names[reason.detail]} moved by {value:.3f} rad during the tare, without any wrench: {why}"
    if cause == Cause.TOO_HEAVY:
        load = f"holding arm and object needs {value:.1f} N m on {joint_names[reason.detail]}, its limit is {limit:.1f}"
        return f"{load}: a lighter object or another posture"
    if cause == Cause.BIASED and reason.detail == Sensor.MASS:
        if value < 0.0:
            return f"the wrench reads the weight of the object with the opposite sign ({value:.3g} kg): turn it round"
        fix = "set it, or allow it with tare.mass_share"
        return f"object.mass is {limit:.3g}, the wrench at rest says {value:.3g}: {fix}"
    if cause == Cause.BIASED:
        name, unit = _OF_SENSOR[Sensor(reason.detail)]
        return f"the {name} reads {value:.3g} {unit} at rest, at most {limit:.3g} are taken out: check it, call ~/tare"
    if cause == Cause.FALLS:
        more = _disturbance_text(reason.detail // 256, joint_names)
        return f"the object falls: it slips, and moves down {value:.2f} m/s faster than the reference{more}"
    return _WORDS[cause]


def _disturbance_text(detail: int, joint_names: Sequence[str]) -> str:
    """Return what `disturbed` has added to a detail, in words."""
    if detail == 0:
        return ""
    tenths, joint = divmod(detail - 1, 256)
    return f"; on {joint_names[joint]} is a disturbance of {0.1 * tenths:.1f} N m beyond effort and wrench"


def finding_text(finding: Finding, joint: str, value: float, limit: float) -> str:
    """Return what is wrong with a joint, in words."""
    if finding == Finding.COLLISION:
        return f"collision: the torque on {joint} jumped by {value:.1f} N m, the limit is {limit:.1f}"
    if finding == Finding.DISTURBED:
        return f"{joint}: disturbance of {value:.1f} N m, at most {limit:.1f} is compensated"
    if finding == Finding.IGNORED:
        return f"{joint} does not take commands: it moves at {value:.2f} rad/s where {limit:.2f} are commanded"
    if finding == Finding.STUCK:
        return f"{joint}: its position and velocity are stuck, though it moves"
    differ = f"position and integrated velocity differ by {value:.4f} rad, the limit is {limit:.4f}"
    return f"{joint}: {_OF_JOINT[finding]}: {differ}"


_OF_JOINT = {
    Finding.NONE: "its measurements contradict each other",
    Finding.VELOCITY: "its velocity contradicts its position",
    Finding.POSITION: "its position is stuck or drifts",
}
_OF_SENSOR = {
    Sensor.NONE: ("sensor", ""),
    Sensor.SLIP: ("slip sensor", "m/s or rad/s"),
    Sensor.WRENCH: ("wrench sensor", "N or N m"),
    Sensor.JOINTS: ("joint velocity", "rad/s"),
    Sensor.MASS: ("weight", "kg"),
}
_AWAY, _TURNED = (Cause.NOT_FOLLOWING, Cause.RANGE_END), (Cause.NOT_TURNING, Cause.RANGE_END_TURNED)
_OF_FAULT = {Cause.INPUT: "", Cause.PREDICTED: ": predicting it from the wrench", Cause.SLOWING: ": slowing down"}
_WORDS = {
    Cause.NONE: "",
    Cause.NO_INPUT_YET: "no input yet",
    Cause.NOT_ENABLED: "not enabled",
    Cause.ASKED: "hold requested",
    Cause.STOPPING: "hold requested: coming to rest first",
    Cause.SLIDES: "the object slides: waiting until it rests",
    Cause.SATURATED: "efforts saturated: slip cannot be driven to zero",
    Cause.PATH_WAITS: "the path waits for the arm",
    Cause.OLD_JOINT_STATE: "joint state is older than the one before",
    Cause.BAD_REFERENCE: "reference is not finite",
    Cause.NO_ESTIMATE: "the slip observer gave no finite estimate",
    Cause.NO_TORQUE: "the law gave no finite torque",
    Cause.TARE: "tare: sensors are read at rest before the law begins",
    Cause.OVERRUNS: "friction is too low to stop on the path: the pad overruns it",
    Cause.ENDLESS_SLIP: "the slip sensor reports slip that does not end: the path goes on without it",
    Cause.GIVEN_UP: "compensation off: the object falls or slips fast all the same; impedance alone",
    Cause.INTERNAL: "internal error, see the log: this is a bug, please report it",
}
