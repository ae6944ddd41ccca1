"""The contact estimate of a cycle: whether and how fast it slips, what friction can carry, and the health of the
sensors.

One record with one reader for each part: the law reads v_s; governor, guard and grip read F_lo and F_median; safety
reads slipping, age and health. Nothing else decides whether the object slips.
"""

from __future__ import annotations

from enum import IntEnum, unique

from slip_core.records import Real, Record, Vec6, Whole

_AXES = "Let the driver report the velocity of the pad relative to the object on the axes of `ee_frame`."
_ONCE = "Let the driver publish each measurement once, with its own stamp."
_UNITS = "Let the driver publish m/s and rad/s; else calibrate it."
_WEIGH = "Pull the object and watch `slip_velocity`; if it responds, `~/tare` at rest or correct `object.mass`."
_STAMPS = "Stamp measurements when they are made; synchronise clocks (chrony, ptp); or set `slip_delay_s`."
_AGAINST = "reads against the friction force: "


@unique
class SensorHealth(IntEnum):
    """Health of a sensor; for the slip sensor also the mistake that its readings show.

    Number, text with value and limit of what was found, and the fix.
    """

    _value_: int
    words: str
    to_do: str

    def __new__(cls, number: int, words: str = "", to_do: str = "") -> SensorHealth:
        """Make a member."""
        member = int.__new__(cls, number)
        member._value_, member.words, member.to_do = number, words, to_do
        return member

    OK = 0
    SILENT = 1, "is silent"
    READS_NOTHING = 2, "reads zero, but the motion needs {value:.2f} N and the wrench shows {limit:.2f} N", _WEIGH
    X_INVERTED = 3, f"{_AGAINST}x is inverted", _AXES
    Y_INVERTED = 4, f"{_AGAINST}y is inverted", _AXES
    Z_INVERTED = 5, f"{_AGAINST}z is inverted", _AXES
    INVERTED = 6, f"{_AGAINST}all axes are inverted", _AXES
    XY_SWAPPED = 7, f"{_AGAINST}x and y are swapped", _AXES
    YZ_SWAPPED = 8, f"{_AGAINST}y and z are swapped", _AXES
    ZX_SWAPPED = 9, f"{_AGAINST}z and x are swapped", _AXES
    TURNED = 10, f"{_AGAINST}it is turned by {{value:.0f}} degrees about z", _AXES
    TURNS_INVERTED = 11, f"{_AGAINST}turning is inverted", _AXES
    HELD = 12, "values change at {value:.0f} Hz, stamps come at {limit:.0f}", _ONCE
    LINEAR_UNIT = 13, "reads {value:.3g} times the speed: is its unit m/s?", _UNITS
    ANGULAR_UNIT = 14, "reads {value:.3g} times the speed of turning: is its unit rad/s?", _UNITS
    STAMPS = 15, "stamps are {value:+.0f} ms off the motion", _STAMPS


class ContactEstimate(Record):
    """Estimate of a contact in a cycle; loads at the nominal grip."""

    v_s: Vec6  # m/s, rad/s {ee}; slip velocity that the law answers
    variance: Vec6  # of the estimated one; zeros without an observer
    slipping: Whole
    slip_ns: Whole  # stamp of the newest sample that shows it
    F_lo: Real  # N; what is certain to be carried
    F_median: Real  # N; F^
    F_risk: Real  # N; what the belief is certain to be carried but for a risk, where the grip follows it
    slipped_at: Real  # N; smallest load at which it has slipped, 0 before
    carried: Real  # N; largest load carried without slip
    first: Real  # N; F^ at first
    age_ns: Whole  # of the newest slip sample
    slip_health: Whole  # SensorHealth
    needs: Real  # N; where the slip sensor reads nothing: load that the motion needs
    lacks: Real  # N; and the one that the wrench shows
