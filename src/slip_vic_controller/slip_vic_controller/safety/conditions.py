"""Conditions: all that speaks against the law, in one table; why the controller is in its mode.

A row is a reason: how severe it is, how long it must last, whether it clears by itself, its words and what to do. The
rows are in the order in which they count: the first one that has lasted decides the mode. What finds that a row is so
(`cycle/judging.py`) reports it with `see`, in any order; `first` is the loop through the table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum, unique
from typing import Annotated, Any, Final, NamedTuple

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Whole, WholeArray, dtype_of
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.sizes import MAX_CONTACTS, NEVER


@unique
class Severity(IntEnum):
    """What a reason leads to; of two the larger one counts."""

    SAMPLE = 0  # nothing by itself: what is wrong with a sample of an input, or with the input
    DEGRADED = 1
    HOLD = 2
    WAITING_INPUT = 3
    FAULT = 4


_SAMPLE, _DEGRADED, _HOLD = Severity.SAMPLE, Severity.DEGRADED, Severity.HOLD
_WAITS, _FAULT = Severity.WAITING_INPUT, Severity.FAULT
_DIFFER = "position and integrated velocity differ by {value:.4f} rad, the limit is {limit:.4f}"
_ENCODER = (
    "Check this joint's encoder, its sign and its driver; after a collision clear the arm. Where efforts are late set "
    "`drive.delay_s`. Then `~/reset_fault`."
)
_RUNAWAY = (
    "Find what made it run: a wrong sign or frame of the wrench, gains too high for a delay. Then `~/reset_fault` and "
    "`~/enable`."
)
_FAST_S: Final = 0.005
"""How long a speed must be too high: a single bad sample is no speed [s]."""
_BRAKE = (
    "Release the joint's brake, clear the arm, or raise `disturbance.limit`: its friction is above the effort. "
    "`slip-vic identify` measures friction."
)
_RANGE = "The path takes the joint farther than it goes: start in another posture (`slip-vic arm FILE` finds one)."
_ZERO = "Zero the named sensor, or fix it; then `~/tare`. Where the bias is its own, raise `tare.*`."
_TAKEN_OUT = "at rest, at most {limit:.3g} are taken out: check it, call ~/tare"
_OFF_MM = "and the pad stays {mm:.0f} mm off its reference"
_OFF_DEGREES = "and the pad stays {degrees:.1f} degrees off its reference"
_SLIP_SENSOR = (
    "Look at the slip sensor: it reads zero, not this contact, or on other axes than those of the pad. Where it is "
    "right, `object.mass` is larger than the object's, or the wrench reads too little: call `~/tare` at rest. "
    "`~/reset_fault` begins again with the configured friction."
)
_MOUNTED = {
    SensorHealth.X_INVERTED: "on x: sign inverted",
    SensorHealth.Y_INVERTED: "on y: sign inverted",
    SensorHealth.Z_INVERTED: "on z: sign inverted",
    SensorHealth.INVERTED: "on all axes: sign inverted",
    SensorHealth.XY_SWAPPED: "x and y swapped",
    SensorHealth.YZ_SWAPPED: "y and z swapped",
    SensorHealth.ZX_SWAPPED: "z and x swapped",
}
_FAULT_OF = "See the fault below; the input is named before it."


@unique
class Reason(IntEnum):
    """The table: a number, the severity, the words and what to do; how long it must last [s], whether it clears itself.

    The words may name the fields of a `Why`, see `describe`. Where a parameter says how long, config.py does. The
    numbers of what is wrong with a sample are part of the ledger's format.
    """

    _value_: int
    severity: Severity
    words: str
    to_do: str
    lasts_s: float
    clears: bool

    def __new__(
        cls,
        number: int,
        severity: Severity = _SAMPLE,
        words: str = "",
        to_do: str = "",
        lasts_s: float = 0.0,
        clears: bool = True,
    ) -> Reason:
        """Make a row; a FAULT never clears by itself."""
        row = int.__new__(cls, number)
        row._value_, row.severity, row.words, row.to_do = number, severity, words, to_do
        row.lasts_s, row.clears = lasts_s, clears and severity != Severity.FAULT
        return row

    NONE = 0
    # -- what is wrong with a sample or an input: said of the input in whose row it stands
    NEVER_SEEN = (1, _SAMPLE, "has never been seen", "Start the sensor; compare topic name, type and QoS.")
    # joint names, sizes, frame_id, not a message of the type
    REFUSED = (2, _SAMPLE, "is refused", "Compare joint names, sizes and `frame_id` with the parameters.")
    NOT_FINITE = (3, _SAMPLE, "is not finite", "The driver sends NaN: a fault of its own, or a division by zero.")
    ABSURD = (4, _SAMPLE, "is absurdly large", "Wrong unit (mm, N mm, degrees)? Else raise `safety.inputs.*`.")
    OUT_OF_ORDER = (6, _SAMPLE, "is out of order", "Two publishers, or a driver that stamps at random.")
    DUPLICATE = (7, _SAMPLE, "comes twice", "A driver that repeats samples; harmless while new ones come too.")
    FUTURE = (8, _SAMPLE, "is ahead of the joint state", "Two clocks: synchronise them (chrony, ptp).")
    CLOCK_JUMP = (9, _SAMPLE, "has a stamp that has jumped", "The clock was set. Wait, or use a clock that slews.")
    JUMP = (10, _SAMPLE, "has jumped", "Joint encoders jumped, or the driver lost samples.")
    RESTARTED = (
        11,
        _SAMPLE,
        "comes from a source that has restarted",
        "Nothing: the driver was restarted, and the trajectory begins from here.",
    )
    SILENT = (12, _SAMPLE, "is silent", "The driver stopped, or the network did.")
    STALE = (13, _SAMPLE, "is too old", "Samples arrive with old stamps: latency of the driver.")
    FROZEN = (
        14,
        _SAMPLE,
        "is frozen",
        "The sensor repeats itself: power, cable, or a quantum larger than what is measured.",
    )
    INVALID = (15, _SAMPLE, "is invalid", "The sensor reports that it cannot measure: light, contact, calibration.")
    SECOND_PUBLISHER = (17, _SAMPLE, "has two publishers", "The reason names the topic: stop one of them.")
    FOREIGN_COMMAND = (
        18,
        _SAMPLE,
        "has another publisher",
        "Another controller commands the arm: stop it, then `~/reset_fault`.",
    )
    NOT_RUN = (
        19,
        _SAMPLE,
        "was not answered for too long",
        "The computer was busy: real-time priority (`--fifo`), a free core (`--cpu`).",
    )
    OTHER_ARM = (
        21,
        _SAMPLE,
        "of the other arm on this object has stopped it",
        "Look at the other arm's mode and reason: both stop and continue together.",
    )
    # -- FAULT
    INTERNAL = (
        22,
        _FAULT,
        "internal error, see the log: this is a bug, please report it",
        "Report it with a bag and the line in the node's log.",
    )
    # which: joint; value, limit [rad/s]
    JOINT_TOO_FAST = (23, _FAULT, "{joint} turns at {value:.1f} rad/s, the limit is {limit:.1f}", _RUNAWAY, _FAST_S)
    # value, limit [m/s]
    PAD_TOO_FAST = (24, _FAULT, "the pad moves at {value:.1f} m/s, the limit is {limit:.1f}", _RUNAWAY, _FAST_S)
    # value, limit [rad/s]
    PAD_TURNS_TOO_FAST = (25, _FAULT, "the pad moves at {value:.1f} rad/s, the limit is {limit:.1f}", _RUNAWAY, _FAST_S)
    # this and the next ones in the order of the estimator's `Finding`; which: joint
    # value: how far position and integrated velocity are apart, limit [rad]
    VELOCITY = (26, _FAULT, "{joint}: its velocity contradicts its position: " + _DIFFER, _ENCODER)
    # the same
    POSITION = (27, _FAULT, "{joint}: its position is stuck or drifts: " + _DIFFER, _ENCODER)
    STUCK = (28, _FAULT, "{joint}: its position and velocity are stuck, though it moves", _ENCODER)
    # value, limit: torque [N m]
    COLLISION = (
        29,
        _FAULT,
        "collision: the torque on {joint} jumped by {value:.1f} N m, the limit is {limit:.1f}",
        _ENCODER,
    )
    # value, limit: torque [N m]
    DISTURBED = (30, _FAULT, "{joint}: disturbance of {value:.1f} N m, at most {limit:.1f} is compensated", _ENCODER)
    # value: its velocity, limit: the commanded one [rad/s]
    IGNORED = (
        31,
        _FAULT,
        "{joint} does not take commands: it moves at {value:.2f} rad/s where {limit:.2f} are commanded",
        _ENCODER,
    )
    # which: joint; value: motion [rad]
    MOVED_IN_TARE = (
        32,
        _FAULT,
        "{joint} moved by {value:.3f} rad during the tare, without any wrench: gravity, load or torque offset are "
        "not those of the model: check object.mass and effort.gravity",
        "Clear the arm. Check `object.mass`, the masses of the URDF, `effort.gravity` and the drives' torque "
        "offsets; then `~/reset_fault`.",
    )
    # value [m/s]
    FALLS = (
        33,
        _FAULT,
        "the object falls: it slips, and moves down {value:.2f} m/s faster than the reference",
        "The object slips out: more grip. Where it does not, `object.mass` or the friction is wrong.",
    )
    EFFORT_COMMAND = (34, _FAULT, "effort command {fault}", _FAULT_OF)
    # -- WAITING_INPUT
    NO_INPUT_YET = (
        35,
        _WAITS,
        "no input yet",
        "Start the drivers. `slip-vic bag record -a` and `bag info` show what is missing.",
    )
    # which: bits of what is missing
    WAITS = (
        36,
        _WAITS,
        "waits for {missing}",
        "The reason names the topics. Remap your driver's topics to these names, and compare `frame_id` and QoS.",
    )
    JOINTS_RESTARTED = (37, _WAITS, "joint state {fault}", _FAULT_OF)
    # which: joint; value: torque at rest, limit [N m]
    TOO_HEAVY = (
        38,
        _WAITS,
        "holding arm and object needs {value:.1f} N m on {joint}, its limit is {limit:.1f}: a lighter object or "
        "another posture",
        "No drive can hold it either: correct `object.mass` or the URDF's effort limits, or start elsewhere; then "
        "`~/enable`.",
        0.0,
        False,
    )
    # -- HOLD
    INPUTS = (39, _HOLD, "an input {fault}", _FAULT_OF)
    WRENCH = (40, _HOLD, "wrench {fault}", _FAULT_OF)
    JOINT_STATE = (41, _HOLD, "joint state {fault}", _FAULT_OF)
    SLIP = (42, _HOLD, "slip velocity {fault}", _FAULT_OF)
    TARE = (
        43,
        _HOLD,
        "tare: sensors are read at rest before the law begins",
        "Wait: it takes `tare.duration_s`, and restarts where a joint moves. Nothing may touch the arm or the object.",
    )
    # this and the next ones in the order of the tare's `Sensor`; value, limit [m/s or rad/s]
    BIASED_SLIP = (44, _HOLD, "the slip sensor reads {value:.3g} m/s or rad/s " + _TAKEN_OUT, _ZERO)
    # value, limit [N or N m]
    BIASED_WRENCH = (45, _HOLD, "the wrench sensor reads {value:.3g} N or N m " + _TAKEN_OUT, _ZERO)
    # value, limit [rad/s]
    BIASED_VELOCITY = (46, _HOLD, "the joint velocity reads {value:.3g} rad/s " + _TAKEN_OUT, _ZERO)
    # value: mass at rest, limit: the configured one [kg]
    WRONG_MASS = (
        47,
        _HOLD,
        "object.mass is {limit:.3g}, the wrench at rest says {value:.3g}: set it, or allow it with tare.mass_share",
        "Set `object.mass`, or raise `tare.mass_share`; then `~/tare`.",
    )
    # the same
    INVERTED_WRENCH = (
        48,
        _HOLD,
        "the wrench reads the weight of the object with the opposite sign ({value:.3g} kg): turn it round",
        "The driver's sign or frame of the wrench is turned round: correct it; then `~/tare`.",
    )
    # value: load of the weight, limit [N]; which: where, time of the trajectory [ms]
    PATH_TOO_HEAVY = (
        49,
        _HOLD,
        "friction cannot carry the object where the path is at {seconds:.3f} s: holding the weight needs "
        "{value:.3f} N, friction can carry {limit:.3f} N",
        "More grip, a lighter object, or another attitude: at that place friction cannot carry the weight. Where "
        "the object was pushed, friction is more than what that slip has taught: `~/reset_fault` plans with the "
        "configured friction.",
    )
    SLIDES = (
        50,
        _HOLD,
        "the object slides: waiting until it rests",
        "More grip, or a slower path. The law begins when the object is at rest in the grasp.",
    )
    OLD_JOINT_STATE = (
        51,
        _HOLD,
        "joint state is older than the one before",
        "Two drivers publish, or stamps go back. Look at `ros2 topic info -v` of the joint states.",
    )
    BAD_REFERENCE = (52, _HOLD, "reference is not finite", "The node that publishes `reference` sends NaN or infinity.")
    NO_ESTIMATE = (
        53,
        _HOLD,
        "the slip observer gave no finite estimate",
        "Report it with a bag: the observer must give a finite estimate for all inputs.",
    )
    NO_TORQUE = (
        54,
        _HOLD,
        "the law gave no finite torque",
        "The arm is in a singular posture or a limit is reached: move it away by hand, then `~/reset_fault`.",
    )
    ASKED = (55, _HOLD, "hold requested", "A user called `~/hold`. `~/enable` ends it.", 0.0, False)
    NOT_ENABLED = (56, _HOLD, "not enabled", "Call `~/enable`, or set `safety.auto_enable`.", 0.0, False)
    # -- DEGRADED
    JOINT_STATE_SLOWS = (
        57,
        _DEGRADED,
        "joint state {fault}: slowing down",
        "The joint sensor has a fault, and the path comes to rest.",
    )
    WRENCH_SLOWS = (
        58,
        _DEGRADED,
        "wrench {fault}: slowing down",
        "The wrench sensor has a fault, and the path comes to rest.",
    )
    SLIP_SLOWS = (
        59,
        _DEGRADED,
        "slip velocity {fault}: slowing down",
        "`safety.fallback.observer_s` is over: fix the slip sensor; the law then continues by itself.",
    )
    SLIP_PREDICTED = (
        60,
        _DEGRADED,
        "slip velocity {fault}: predicting it from the wrench",
        "The slip sensor has a fault; the observer continues for `safety.fallback.observer_s`.",
    )
    STOPPING = (61, _DEGRADED, "hold requested: coming to rest first", "Wait: it comes to rest along the path first.")
    SATURATED = (
        62,
        _DEGRADED,
        "efforts saturated: slip cannot be driven to zero",
        "The law needs more than the joints have: a slower path, or the governor; see safety.md for "
        "`safety.limits.effort_rate`.",
        0.1,
    )
    # which: joint; value: torque on it beyond what it needs at rest [N m], limit: error [m]
    NOT_FOLLOWING = (
        63,
        _DEGRADED,
        "{joint} does not follow: {value:.2f} N m more than it needs at rest do not move it, " + _OFF_MM,
        _BRAKE,
    )
    # the same where only the attitude is far; limit: error [rad]
    NOT_TURNING = (
        64,
        _DEGRADED,
        "{joint} does not follow: {value:.2f} N m more than it needs at rest do not move it, " + _OFF_DEGREES,
        _BRAKE,
    )
    # which: joint; value: its position [rad], limit: error [m]
    RANGE_END = (65, _DEGRADED, "{joint} is at the end of its range, at {value:.2f} rad, " + _OFF_MM, _RANGE)
    # the same where only the attitude is far; limit: error [rad]
    RANGE_END_TURNED = (
        66,
        _DEGRADED,
        "{joint} is at the end of its range, at {value:.2f} rad, " + _OFF_DEGREES,
        _RANGE,
    )
    # value: load that the motion needs, limit: that is measured [N]
    READS_NOTHING = (
        67,
        _DEGRADED,
        "the wrench shows {limit:.2f} N where the motion needs {value:.2f} N, and slip_velocity reads nothing",
        _SLIP_SENSOR,
    )
    # which: the contact's SensorHealth of the slip sensor
    MISMOUNTED = (
        68,
        _DEGRADED,
        "slip_velocity reads against the friction force, {mounted}",
        _SLIP_SENSOR,
    )
    # which: joint; value: its position [rad]
    PUSHED_BACK = (
        69,
        _DEGRADED,
        "{joint} is pushed back from the end of its range, at {value:.2f} rad: the pad cannot keep to the path",
        _RANGE,
    )
    OVERRUNS = (
        70,
        _DEGRADED,
        "friction is too low to stop on the path: the pad overruns it",
        "The friction fell while it moved. More grip; `governor.margin` leaves more room.",
    )
    ENDLESS_SLIP = (
        71,
        _DEGRADED,
        "the slip sensor reports slip that does not end: the path goes on without it",
        "Pads tremble with the joints, or a bias came after the tare: `~/tare` at rest, or a larger "
        "`governor.pre_sliding`.",
    )
    GIVEN_UP = (
        72,
        _DEGRADED,
        "compensation off: the object falls or slips fast all the same; impedance alone",
        "Object or contact differ from the configuration: check `object.mass`, `contacts.position` and the "
        "wrench's frame.",
    )
    PATH_WAITS = (
        73,
        _DEGRADED,
        "the path waits for the arm",
        "The arm does not follow: something blocks it, or the gains are too soft for the path.",
    )


REASONS: Final = max(Reason) + 1
SAMPLE_FAULTS: Final = Reason.INTERNAL.value
"""How many reasons, `NONE` among them, are faults of a sample or an input."""
_OF_NUMBER = {reason.value: reason.severity.value for reason in Reason}
SEVERITIES: Final = tuple(_OF_NUMBER.get(number, 0) for number in range(REASONS))


@unique
class Missing(IntEnum):
    """Bits of what is missing."""

    ACTIVATION = 1
    GOOD_JOINT_STATE = 2
    JOINT_STATES = 4
    WRENCH = 8  # of the first contact; those of the others follow, then their slips


@unique
class Prefix(IntEnum):
    """Words before a reason; bits."""

    NONE = 0
    ASKED_AND = 1
    RESUMES_AFTER = 2
    AFTER_RESET = 4


class WhyRecord(Record):
    """A `Why` in a buffer."""

    reason: Whole  # Reason
    fault: Whole  # Reason: what is wrong with the input that it is about
    prefix: Whole  # bits of Prefix
    which: Whole  # joint, bits or place, see Reason
    value: Real  # unit: see Reason
    limit: Real  # unit: see Reason
    joint: Whole  # on which a disturbance may be behind it; -1 = none
    torque: Real  # N m; that disturbance


class Why(NamedTuple):
    """Why the controller does what it does: a row of the table, and its fields as in `WhyRecord`."""

    reason: int
    fault: int
    prefix: int
    which: int
    value: float
    limit: float
    joint: int
    torque: float


NOTHING = Why(0, 0, 0, 0, 0.0, 0.0, -1, 0.0)


class Condition(Record):
    """A row of the table in a cycle."""

    since_ns: Whole  # since when it is so, NEVER where it is not
    fault: Whole
    which: Whole
    value: Real
    limit: Real


class ConditionsConfig(Record):
    """How long conditions must last, and what else is configured of them."""

    lasts_ns: Annotated[WholeArray, REASONS]
    slow_down_ns: Whole  # time for the path to come to rest
    bridge_ns: Whole  # how long the law continues where the model has an arm that is not measured
    unseen_ns: Whole  # the same, with the time in which the path comes to rest
    gap_ns: Whole  # pause of the controller itself that is too long
    slip_needed: Whole  # whether the law needs the slip velocity


class Health(Record):
    """What is wrong with each input in a cycle: Reason, NONE = good."""

    joint: Whole
    wrench: Whole  # the worst of all contacts
    slip: Whole  # the worst of all contacts
    outside: Whole  # who else publishes


HEALTH = dtype_of(Health)


@part
def because(reason: int, which: int) -> Why:
    """Return why without numbers."""
    return Why(0 + reason, 0, 0, int(which), 0.0, 0.0, -1, 0.0)


@part
def of_fault(reason: int, fault: int) -> Why:
    """Return that an input has a fault; reason: the row of the input."""
    return Why(0 + reason, 0 + fault, 0, 0, 0.0, 0.0, -1, 0.0)


@part
def prefixed(why: Why, prefix: int) -> Why:
    """Return why with something said before it."""
    return Why(why.reason, why.fault, why.prefix | prefix, why.which, why.value, why.limit, why.joint, why.torque)


@part
def read_why(r: WhyRecord) -> Why:
    """Return what is in a record."""
    return Why(r.reason, r.fault, r.prefix, r.which, r.value, r.limit, r.joint, r.torque)


@part
def put_why(r: WhyRecord, why: Why) -> None:
    """Write to a record."""
    r.reason, r.fault, r.prefix, r.which = why.reason, why.fault, why.prefix, why.which
    r.value, r.limit, r.joint, r.torque = why.value, why.limit, why.joint, why.torque


@part
def same_words(a: Why, b: Why) -> bool:
    """Return whether two are the same but for their numbers."""
    return bool(a.reason == b.reason and a.fault == b.fault and a.prefix == b.prefix and a.which == b.which)


@part
def since_when(since_ns: int, so: bool, now_ns: int) -> int:
    """Return since when something is so [ns], NEVER where it is not; since_ns: since when it was so until now."""
    if not so:
        return NEVER
    return now_ns if since_ns == NEVER else since_ns


@part
def see(rows: Records[Condition], why: Why, so: bool, now_ns: int) -> None:
    """Take down whether a condition is so in this cycle, and its fields."""
    row = rows[why.reason]
    row.since_ns = since_when(row.since_ns, so, now_ns)
    row.fault, row.which, row.value, row.limit = why.fault, why.which, why.value, why.limit


@part
def forget_conditions(rows: Records[Condition]) -> None:
    """Begin: nothing is so."""
    for k in range(REASONS):
        rows[k].since_ns = NEVER


@part
def passed_ns(row: Condition, now_ns: int) -> int:
    """Return for how long a condition has been so [ns], -1 where it is not."""
    return now_ns - row.since_ns if row.since_ns != NEVER else -1


@part
def lasted(config: ConditionsConfig, rows: Records[Condition], reason: int, now_ns: int) -> bool:
    """Return whether a condition has been so for as long as it must."""
    return bool(passed_ns(rows[reason], now_ns) >= config.lasts_ns[reason])


@part
def first(config: ConditionsConfig, rows: Records[Condition], now_ns: int) -> Why:
    """Return the first condition of the table that has lasted, NOTHING where none has."""
    for k in range(SAMPLE_FAULTS, REASONS):
        if lasted(config, rows, k, now_ns):
            row = rows[k]
            return Why(k, row.fault, 0, row.which, row.value, row.limit, -1, 0.0)
    return NOTHING


# -- outside of the cycle -----------------------------------------------------------------------------


def describe(why: Why | WhyRecord | Any, joint_names: Sequence[str]) -> str:
    """Return the words for it; an empty text where there is nothing."""
    if why.reason == Reason.NONE:
        return ""
    text = Reason(why.reason).words.format(**_fields(why, joint_names))
    if why.joint >= 0:
        disturbed = f"is a disturbance of {why.torque:.1f} N m beyond effort and wrench"
        text = f"{text}; on {_name(why.joint, joint_names)} {disturbed}"
    if why.prefix & Prefix.ASKED_AND:
        text = f"hold requested; {text}"
    if why.prefix & Prefix.AFTER_RESET:
        text = f"not enabled, after a reset of: {text}"
    return f"resumes after: {text}" if why.prefix & Prefix.RESUMES_AFTER else text


def reason_fields(why: Any, joint_names: Sequence[str]) -> dict[str, object]:
    """Return what is published beside the words: name and number, what is wrong with an input, and the numbers."""
    reason = Reason(why.reason)
    return {
        "reason": reason.name,
        "reason_number": reason.value,
        "fault": Reason(why.fault).name,
        "which": _name(why.which, joint_names) if "{joint}" in reason.words else why.which,
        "value": f"{why.value:.6g}",
        "limit": f"{why.limit:.6g}",
    }


def _fields(why: Any, joint_names: Sequence[str]) -> dict[str, object]:
    """Return what the words of a row may name."""
    return {
        "value": why.value, "limit": why.limit, "joint": _name(why.which, joint_names),
        "fault": Reason(why.fault).words, "missing": ", ".join(missing_words(why.which)),
        "mm": 1e3 * why.limit, "degrees": math.degrees(why.limit), "seconds": 1e-3 * why.which,
        "mounted": _MOUNTED.get(why.which, ""),
    }  # fmt: skip


def _name(joint: int, joint_names: Sequence[str]) -> str:
    return joint_names[joint] if 0 <= joint < len(joint_names) else ""


def missing_words(bits: int) -> list[str]:
    """Return what is missing."""
    names = ["activation"] if bits & Missing.ACTIVATION else []
    names += ["a good joint state"] if bits & Missing.GOOD_JOINT_STATE else []
    names += ["joint_states"] if bits & Missing.JOINT_STATES else []
    for i in range(2 * MAX_CONTACTS):
        if bits & (Missing.WRENCH << i):
            name = "wrench" if i < MAX_CONTACTS else "slip"
            names.append(f"{name} of contact {i % MAX_CONTACTS}")
    return names
