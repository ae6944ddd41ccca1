"""A load that stays below what the motion needs is a slip, with the slip sensor or without it."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from slip_core.vectors import ZERO, Spatial, Vec
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.contact.friction_estimate import (
    LEAST_FRICTION,
    Friction,
    FrictionConfig,
    FrictionEvidence,
    learn_carried,
    start_friction,
)
from slip_vic_controller.contact.wrench_evidence import (
    LACKS_S,
    MEAN_S,
    SCATTERS,
    WrenchEvidence,
    lacks_load,
    start_evidence,
)
from slip_vic_controller.sizes import NEVER
from test.support.call import blank, left

DT, MS = 1e-3, 1_000_000


def evidence() -> SimpleNamespace:
    """Return the evidence of a contact that has carried nothing yet."""
    state = blank(WrenchEvidence)
    start_evidence(state)
    return SimpleNamespace(state=state, contact=blank(ContactEstimate))


def run(e: SimpleNamespace, cycles: int, needed: float, measured: float, seen: int = 0, observed: bool = False) -> int:
    """Do cycles of equal loads [N] along one axis; return in which one a slip was found, -1 = in none."""
    found, e.contact.slipping = -1, seen
    for k in range(cycles):
        need, load = Spatial(Vec(needed, 0.0, 0.0), ZERO), Spatial(Vec(measured, 0.0, 0.0), ZERO)
        if lacks_load(e.state, e.contact, need, load, 0.25, observed, k * MS, DT) and found < 0:
            found = k
    return found


def carry(e: SimpleNamespace, load: float) -> None:
    """Let the means come to a load that is carried in full [N]."""
    assert run(e, 1000, load, load) == -1


@pytest.mark.parametrize(("share", "observed"), [(0.5, False), (0.7, False), (0.8, False), (0.8, True), (0.93, True)])
def test_time_to_find_a_slip(share: float, observed: bool) -> None:
    e = evidence()
    carry(e, 0.2)
    # Closed form of the sum: lack(t) = (1 - share) (1 - exp(-t / MEAN_S)), counted beyond SCATTERS, or in full.
    t, S, kept, scatters = 0.0, 0.0, 0.0, 0.0 if observed else SCATTERS
    while S <= LACKS_S:
        t += DT
        lack = (1.0 - share) * (1.0 - math.exp(-t / MEAN_S))
        S, kept = max(S + DT * (lack - scatters), 0.0), kept + DT * max(lack - scatters, 0.0) * 0.2 * (1.0 - lack)
    assert run(e, 1000, 0.2, share * 0.2, observed=observed) == round(t / DT) - 1
    assert (e.contact.needs, e.state.unseen_ns) == (pytest.approx(0.2), (round(t / DT) - 1) * MS)
    assert e.contact.lacks == pytest.approx(kept / S)


@pytest.mark.parametrize(
    ("needed", "measured"),
    [
        (0.2, 0.2),
        (0.2, (1.0 - 0.99 * SCATTERS) * 0.2),  # scatter
        (0.0, 0.0),  # the arm is stuck, whatever is commanded
        (0.05, 0.05 - 0.99 * SCATTERS * LEAST_FRICTION * 0.25),  # a load that does not count
        (0.1, 0.2),  # a push
    ],
)
def test_no_slip_without_lack(needed: float, measured: float) -> None:
    assert run(evidence(), 3000, needed, measured) == -1


@pytest.mark.parametrize(("along", "found"), [(0.1, 0), (0.18, 1)])
def test_only_what_is_missing_along_the_load_counts(along: float, found: int) -> None:
    """Noise of the pad's acceleration across the load makes the vector longer."""
    e = evidence()
    need, load = Spatial(Vec(along, 0.15, 0.0), ZERO), Spatial(Vec(0.1, 0.0, 0.0), ZERO)
    count = sum(lacks_load(e.state, e.contact, need, load, 0.25, False, k * MS, DT) for k in range(2000))
    assert count == found


@pytest.mark.parametrize(("bias", "first"), [(0.05, 0.2), (0.05, 0.0), (-0.05, 0.0)])
def test_a_bias_that_has_shown_is_no_lack(bias: float, first: float) -> None:
    """It adds to the load of one direction and lacks in the other, as in a motion that speeds up and brakes."""
    e = evidence()
    assert run(e, 1000, first, first + bias) == -1
    assert run(e, 1000, -0.2 * np.sign(bias), (-0.2 + abs(bias)) * np.sign(bias)) == -1
    assert run(e, 1000, -0.2 * np.sign(bias), -0.1 * np.sign(bias)) >= 0, "a slip lacks more"


def test_the_slip_sensor_sees_it() -> None:
    e = evidence()
    carry(e, 0.2)
    run(e, 500, 0.2, 0.1)
    assert e.state.unseen_ns != NEVER
    assert run(e, 1, 0.2, 0.1, seen=1) == -1
    assert (e.state.unseen_ns, e.state.sum_s) == (NEVER, 0.0)


def test_a_wrong_mass_counts_once() -> None:
    e = evidence()
    assert run(e, 500, 0.2, 0.12) >= 0
    assert run(e, 2000, 0.15, 0.09) == -1, "nothing has been carried in full since"
    carry(e, 0.15)
    assert run(e, 500, 0.15, 0.09) >= 0


@pytest.mark.parametrize(("needed", "found"), [(0.225 * LEAST_FRICTION, False), (0.275 * LEAST_FRICTION, True)])
def test_small_loads_are_not_judged(needed: float, found: bool) -> None:
    """A bias of the wrench may be all that is missing; of a larger load friction may carry as little."""
    assert (run(evidence(), 2000, needed, 0.1 * needed) >= 0) is found


def test_noise_is_no_load() -> None:
    e, rng, found = evidence(), np.random.default_rng(3), 0
    for k in range(20_000):
        noisy = Spatial(Vec(0.15 + 0.05 * rng.standard_normal(), 0.05 * rng.standard_normal(), 0.0), ZERO)
        need = Spatial(Vec(0.15, 0.0, 0.0), ZERO)
        found += lacks_load(e.state, e.contact, need, noisy, 0.25, False, k * MS, DT)
    assert found == 0


@pytest.mark.parametrize(
    ("friction", "carried", "F_hat"),
    [
        (Friction.LEARNT, 0.6, 0.57),
        (Friction.LEARNT, 1.2, 1.0),
        (Friction.KNOWN, 0.6, 1.0),
        (Friction.LEARNT, 0.0, 0.01),
    ],
)
def test_friction_from_the_load_left(friction: Friction, carried: float, F_hat: float) -> None:
    config, contact, state = map(blank, (FrictionConfig, ContactEstimate, FrictionEvidence))
    config.friction, config.configured, config.least, config.probe = friction, 1.0, 0.01, 0.02
    start_friction(config, contact, state, 0.8, 0.0)
    learn_carried(config, contact, state, carried)
    assert (contact.F_median, state.events, contact.carried) == (
        pytest.approx(F_hat), int(F_hat < 1.0), pytest.approx(min(0.82, F_hat))
    )  # fmt: skip


def test_nothing_of_before_remains() -> None:
    assert left(start_evidence, WrenchEvidence) == {"unseen_ns": NEVER}
