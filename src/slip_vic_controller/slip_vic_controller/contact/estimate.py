"""The contact estimate of a cycle: is it slipping, how fast, what can friction carry, and may the sensors be believed.

One record with one reader for each part: the law reads v_s; governor, guard and grip read F_lo and F_median; safety
reads slipping, age and health. Nothing else decides whether the object slips.
"""

from __future__ import annotations

from enum import IntEnum, unique

from slip_core.records import Real, Record, Vec6, Whole, dtype_of


@unique
class SensorHealth(IntEnum):
    """Whether a sensor may be believed; of the slip sensor also how it contradicts the friction force."""

    OK = 0
    SILENT = 1
    READS_NOTHING = 2
    X_INVERTED = 3
    Y_INVERTED = 4
    Z_INVERTED = 5
    INVERTED = 6
    XY_SWAPPED = 7
    YZ_SWAPPED = 8
    ZX_SWAPPED = 9


class ContactEstimate(Record):
    """What is known of a contact in a cycle; loads at the nominal grip."""

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
    wrench_health: Whole  # SensorHealth
    needs: Real  # N; where the slip sensor reads nothing: load that the motion needs
    lacks: Real  # N; and the one that the wrench shows


CONTACT_ESTIMATE = dtype_of(ContactEstimate)
