"""Conditions and modes: all that speaks against the law, in one table, and what the controller does and why.

A row is a reason: the mode that it leads to, its words, how long it must last, whether it clears by itself. The rows
are in the order in which they count: the first one that has lasted decides the mode. What finds that a row is so
(`cycle/deciding.py`) reports it with `see`, in any order; `first` is the loop through the table. docs/faults.csv has
cause and fix of each. The modes, with time as an argument:

WAITING_INPUT  no effort: an input has never been seen, or the joint state's source has restarted
HOLD           gravity compensation, damping and posture
ACTIVE         the law
DEGRADED       the law with a fallback, and the reason
FAULT          as HOLD, until a user resets it
"""

from __future__ import annotations

from enum import IntEnum, unique
from typing import Annotated, Final, NamedTuple

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Whole, WholeArray
from slip_vic_controller.sizes import NEVER


@unique
class Mode(IntEnum):
    """Modes in the order of their numbers on the topics."""

    WAITING_INPUT = 0
    HOLD = 1
    ACTIVE = 2
    DEGRADED = 3
    FAULT = 4

    @property
    def follows(self) -> bool:
        """Whether the law is active."""
        return self in (Mode.ACTIVE, Mode.DEGRADED)


_DEGRADED, _HOLD, _WAITS, _FAULT = Mode.DEGRADED, Mode.HOLD, Mode.WAITING_INPUT, Mode.FAULT


@unique
class Reason(IntEnum):
    """The table: number, words; the mode that it leads to, how long it must last [s], whether it clears itself.

    What is wrong with a sample leads to nothing by itself: its row has ACTIVE. The words may name the fields of a
    `Why`, see `session/words.py`. Where a parameter says how long, `config` does. The numbers of what is wrong with a
    sample are part of the ledger's format.
    """

    _value_: int
    words: str
    mode: Mode
    lasts_s: float
    clears: bool

    def __new__(
        cls, number: int, words: str = "", mode: Mode = Mode.ACTIVE, lasts_s: float = 0.0, clears: bool = True
    ) -> Reason:
        """Make a row; a FAULT never clears by itself."""
        row = int.__new__(cls, number)
        row._value_, row.mode, row.words = number, mode, words
        row.lasts_s, row.clears = lasts_s, clears and mode != Mode.FAULT
        return row

    NONE = 0
    # -- what is wrong with a sample or an input: said of the input in whose row it stands
    UNSTAMPED = 1, "has no stamp"
    REFUSED = 2, "is refused"
    NOT_FINITE = 3, "is not finite"
    ABSURD = 4, "is absurdly large: wrong unit?"
    AHEAD = 5, "has stamps ahead of all others: joint_states"
    OUT_OF_ORDER = 6, "is out of order"
    FUTURE = 8, "is ahead of the joint state"
    CLOCK_JUMP = 9, "has a stamp that has jumped"
    JUMP = 10, "has jumped"
    RESTARTED = 11, "comes from a source that has restarted"
    SILENT = 12, "is silent"
    STALE = 13, "has stamps too far behind joint_states"
    FROZEN = 14, "is frozen"
    INVALID = 15, "is invalid"
    SECOND_PUBLISHER = 17, "has two publishers"
    FOREIGN_COMMAND = 18, "has another publisher"
    NOT_RUN = 19, "was not answered for too long"
    OTHER_ARM = 21, "of the other arm on this object has stopped it"
    # -- FAULT
    INTERNAL = 22, "internal error: this is a bug", _FAULT
    # which: joint, -1 = the pad
    TOO_FAST = 23, "{joint} moves at {value:.1f} rad/s or m/s, the limit is {limit:.1f}", _FAULT, 0.005
    # this and the next two in the order of `Trust` in what is left; which: joint
    VELOCITY = 26, "{joint}: velocity and position disagree by {value:.4f} rad", _FAULT
    POSITION = 27, "{joint}: position is stuck or drifts by {value:.4f} rad", _FAULT
    STUCK = 28, "{joint}: position and velocity are stuck while the joint moves", _FAULT
    COLLISION = 29, "collision: torque on {joint} jumped by {value:.1f} N m, the limit is {limit:.1f}", _FAULT
    DISTURBED = 30, "{joint}: disturbance of {value:.1f} N m, at most {limit:.1f} is compensated", _FAULT
    IGNORED = 31, "{joint} ignores commands: {value:.2f} rad/s where {limit:.2f} are commanded", _FAULT
    MOVED_IN_TARE = 32, "{joint} moved by {value:.3f} rad during the tare, without any wrench", _FAULT
    FALLS = 33, "the object falls: {value:.2f} m/s faster than the reference", _FAULT
    EFFORT_COMMAND = 34, "effort command {fault}", _FAULT
    # -- WAITING_INPUT
    # which: bits of what is missing
    WAITS = 36, "waits for {missing}", _WAITS
    TOO_HEAVY = (
        38,
        "holding arm and object needs {value:.1f} N m on {joint}, its limit is {limit:.1f}",
        _WAITS,
        0.0,
        False,
    )
    # -- HOLD
    INPUTS = 39, "an input {fault}", _HOLD
    WRENCH = 40, "wrench {fault}", _HOLD
    JOINT_STATE = 41, "joint state {fault}", _HOLD
    SLIP = 42, "slip velocity {fault}", _HOLD
    TARE = 43, "tare: measuring the sensors at rest before the law starts", _HOLD
    BIASED = 44, "{sensor} reads {value:.3g} at rest, the tare removes at most {limit:.3g}", _HOLD
    WRONG_MASS = 47, "object.mass is {limit:.3g}, the wrench at rest shows {value:.3g}", _HOLD
    INVERTED_WRENCH = 48, "the wrench shows the weight with the opposite sign ({value:.3g} kg)", _HOLD
    # which: where, time of the trajectory [ms]
    PATH_TOO_HEAVY = (
        49,
        "friction cannot carry the object at {which} ms of the path: it needs {value:.3f} N and has {limit:.3f} N",
        _HOLD,
    )
    BAD_REFERENCE = 52, "reference is not finite", _HOLD
    NO_ESTIMATE = 53, "the slip estimate is not finite", _HOLD
    NO_TORQUE = 54, "the torque of the law is not finite", _HOLD
    ASKED = 55, "hold requested", _HOLD, 0.0, False
    NOT_ENABLED = 56, "not enabled", _HOLD, 0.0, False
    # -- DEGRADED
    JOINT_STATE_SLOWS = 57, "joint state {fault}: slowing down", _DEGRADED
    WRENCH_SLOWS = 58, "wrench {fault}: slowing down", _DEGRADED
    SLIP_SLOWS = 59, "slip velocity {fault}: slowing down", _DEGRADED
    SLIP_PREDICTED = 60, "slip velocity {fault}: predicting it from the wrench", _DEGRADED
    STOPPING = 61, "hold requested: coming to rest first", _DEGRADED
    SATURATED = 62, "efforts saturated", _DEGRADED, 0.1
    # which: the contact's SensorHealth of the slip sensor, with its numbers
    SLIP_SENSOR = 68, "slip_velocity {mistake}: relying on the wrench", _DEGRADED
    # value: load beyond that of the model [N]
    HAND = 69, "a hand pulls at the object: {value:.2f} N beyond its weight", _DEGRADED, 0.2
    OVERRUNS = 70, "friction is too low to stop on the path", _DEGRADED
    ENDLESS_SLIP = 71, "the slip readings do not end: the path continues without them", _DEGRADED
    GIVEN_UP = 72, "slip compensation is off: the object kept slipping fast", _DEGRADED
    PATH_WAITS = 73, "the path waits for the arm", _DEGRADED


REASONS: Final = max(Reason) + 1
SAMPLE_FAULTS: Final = Reason.INTERNAL.value
"""How many reasons, `NONE` among them, are faults of a sample or an input."""
_OF_NUMBER = {reason.value: reason.mode.value for reason in Reason}
LEADS_TO: Final = tuple(_OF_NUMBER.get(number, Mode.ACTIVE.value) for number in range(REASONS))
"""Mode by the number of its reason."""


@unique
class Missing(IntEnum):
    """Bits of what is missing."""

    ACTIVATION = 1
    GOOD_JOINT_STATE = 2
    JOINT_STATES = 4
    WRENCH = 8  # of the first contact; those of the others follow, then their slips


class WhyRecord(Record):
    """A `Why` in a buffer."""

    reason: Whole  # Reason
    fault: Whole  # Reason: what is wrong with the input that it is about
    over: Whole  # whether it has ended, and the law resumes soon
    which: Whole  # joint, bits or place, see Reason
    value: Real  # unit: see Reason
    limit: Real  # unit: see Reason


class Why(NamedTuple):
    """Why the controller does what it does: a row of the table, and its fields as in `WhyRecord`."""

    reason: int
    fault: int
    over: int
    which: int
    value: float
    limit: float


NOTHING = Why(0, 0, 0, 0, 0.0, 0.0)


class Condition(Record):
    """A row of the table in a cycle."""

    since_ns: Whole  # since when it is so, NEVER where it is not
    why: WhyRecord


class ConditionsConfig(Record):
    """How long conditions must last, and what else is configured of them."""

    lasts_ns: Annotated[WholeArray, REASONS]
    slow_down_ns: Whole  # time for the path to come to rest
    bridge_ns: Whole  # how long the law continues where the model has an arm that is not measured
    unseen_ns: Whole  # the same, with the time in which the path comes to rest
    slip_needed: Whole  # whether the law needs the slip velocity
    auto_enable: Whole  # whether the law begins without a user
    resume_after_ns: Whole  # how long what spoke against the law must be gone


class Health(Record):
    """What is wrong with each input in a cycle: Reason, NONE = good."""

    joint: Whole
    wrench: Whole  # the worst of all contacts
    slip: Whole  # the worst of all contacts
    outside: Whole  # who else publishes


@part
def because(reason: int, fault: int) -> Why:
    """Return why without numbers; fault: of the input in whose row it stands, NONE of another reason."""
    return Why(0 + reason, 0 + fault, 0, 0, 0.0, 0.0)


@part
def read_why(r: WhyRecord) -> Why:
    """Return what is in a record."""
    return Why(r.reason, r.fault, r.over, r.which, r.value, r.limit)


@part
def put_why(r: WhyRecord, why: Why) -> None:
    """Write to a record."""
    r.reason, r.fault, r.over, r.which = why.reason, why.fault, why.over, why.which
    r.value, r.limit = why.value, why.limit


@part
def find(found: WhyRecord, reason: int, which: int, value: float, limit: float) -> None:
    """Record what is wrong; the first finding stays until it is cleared."""
    if found.reason == Reason.NONE:
        put_why(found, Why(0 + reason, 0, 0, which, value, limit))


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
    put_why(row.why, why)


@part
def see_one_of(rows: Records[Condition], first_row: int, last_row: int, why: Why, now_ns: int) -> None:
    """Take down which of neighbouring rows is so: that of `why`, and no other."""
    for k in range(first_row, last_row + 1):
        see(rows, Why(k, why.fault, 0, why.which, why.value, why.limit), k == why.reason, now_ns)


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
            why = rows[k].why
            return Why(k, why.fault, 0, why.which, why.value, why.limit)
    return NOTHING


# -- modes ----------------------------------------------------------------------------------------------


@unique
class Request(IntEnum):
    """Requests since the last cycle, from a user unless stated otherwise."""

    NONE = 0
    ENABLE = 1
    HOLD = 2
    RESET_FAULT = 3
    TARE = 5  # read the sensors at rest again; not while the law is active
    FAILED = 4  # the node itself requests FAULT: one of its callbacks has failed


class ModeState(Record):
    """The mode and its history."""

    mode: Whole  # Mode
    enabled: Whole  # whether the law is wanted
    good_since_ns: Whole  # since when nothing speaks against the law, NEVER = something does
    reason: WhyRecord


@part
def follows(mode: int) -> bool:
    """Return whether the law is active in a mode."""
    return bool(mode == Mode.ACTIVE or mode == Mode.DEGRADED)


@part
def holds_for(state: ModeState, reason: int, fault: int) -> bool:
    """Return whether a fault of an input is why the law does not work; reason: the row of the input.

    A sensor that is frozen shows it while the arm moves only, so it stays frozen until it reads something else.
    """
    return bool(state.reason.over == 0 and state.reason.reason == reason and state.reason.fault == fault)


@part
def next_mode(config: ConditionsConfig, state: ModeState, why: Why, request: int, now_ns: int) -> None:
    """Go to the mode of this cycle; why: what speaks against the law, NOTHING where nothing does.

    A fault latches; a request to hold wins over one to continue; what inputs caused ends with its cause, what a user or
    a fault caused ends by a user.
    """
    if request == Request.FAILED:
        why = because(Reason.INTERNAL.value, 0)
    mode, before = LEADS_TO[why.reason], read_why(state.reason)
    stops = mode == Mode.WAITING_INPUT or mode == Mode.HOLD
    enabled = request == Request.ENABLE or (state.enabled != 0 and request != Request.HOLD and state.mode != Mode.FAULT)
    good_since = since_when(state.good_since_ns, not stops or why.reason == Reason.TARE, now_ns)
    rests = not stops and state.mode == Mode.HOLD and request != Request.ENABLE
    if state.mode == Mode.FAULT and request != Request.RESET_FAULT:
        mode, why, enabled = Mode.FAULT.value, before, False
    elif mode == Mode.FAULT:
        enabled = False
    elif not stops and not enabled:
        asked = request == Request.HOLD or before.reason == Reason.ASKED
        mode, why = Mode.HOLD.value, because(Reason.ASKED.value if asked else Reason.NOT_ENABLED.value, 0)
    elif rests and now_ns - good_since < config.resume_after_ns:
        mode, why = Mode.HOLD.value, Why(before.reason, before.fault, 1, before.which, before.value, before.limit)
    state.mode, state.enabled, state.good_since_ns = 0 + mode, 1 if enabled else 0, good_since
    put_why(state.reason, why)
