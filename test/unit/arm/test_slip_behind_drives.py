"""Slip behind drives with loops of their own: it is predicted to where the commands under way lead, and ends."""

from __future__ import annotations

import numpy as np
import pytest

from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.law.bounds import slip_gain_limit
from slip_vic_controller.law.gains import UNKNOWN_LAG, gain_report

T, DELAY_S, BANDWIDTH = 1e-3, 0.008, 40.0
LAG_S = DELAY_S + 1.0 / BANDWIDTH
FRICTION = 3.0


def slip_after(seconds: float, k_s: float, share: float, delay_s: float, bandwidth: float) -> np.ndarray:
    """Return the slip [m/s] of a pad behind a drive on an object that friction moves at FRICTION [m/s^2].

    The law is a_C = a_o - k_s v, v the slip predicted over `share` of LAG_S, 0 = as it is.
    Drive: `delay_s` [s], `bandwidth` [rad/s].
    """
    commands, pad, thing, slips = [0.1] * 100, 0.1, 0.0, []
    for _ in range(round(seconds / T)):
        slip = pad - thing
        ahead = slip + commands[-1] - pad - share * LAG_S * FRICTION
        if share == 0.0:
            ahead = slip
        commands.append(commands[-1] + T * (FRICTION - k_s * ahead))
        pad += (1.0 - np.exp(-bandwidth * T)) * (commands[-1 - round(delay_s / T)] - pad)
        thing += T * FRICTION
        slips.append(slip)
    return np.array(slips)


def test_with_constant_acceleration_the_predicted_slip_is_that_of_later() -> None:
    """Commands that grow as fast as the object: the pad is behind them by the lag, and so is the slip."""
    acceleration, pad, commands = FRICTION, 0.0, [0.0] * 100
    pads = []
    for _ in range(1000):
        commands.append(commands[-1] + T * acceleration)
        pad += (1.0 - np.exp(-BANDWIDTH * T)) * (commands[-1 - round(DELAY_S / T)] - pad)
        pads.append(pad)
    now, later = 700, 700 + round(LAG_S / T)
    thing = FRICTION * T * np.arange(1000)
    ahead = pads[now] - thing[now] + (commands[100 + now] - pads[now]) - LAG_S * FRICTION
    assert ahead == pytest.approx(pads[later] - thing[later], abs=2e-3 * FRICTION)


DRIVES = (DELAY_S, BANDWIDTH), (0.010, BANDWIDTH), (DELAY_S, 28.0), (0.010, 28.0), (DELAY_S, 52.0)
"""Dead time [s] and bandwidth [rad/s] of drives that are configured as the first."""


@pytest.mark.parametrize(("delay_s", "bandwidth"), DRIVES)
def test_a_predicted_slip_does_not_swing_where_the_drives_are_others_than_configured(
    delay_s: float, bandwidth: float
) -> None:
    """Nor where the measured one does: at its bound, without a margin, that takes long to end."""
    bound = slip_gain_limit(T, latency_s=UNKNOWN_LAG * LAG_S)
    slip = slip_after(1.0, bound / 2.0, 1.0 - UNKNOWN_LAG, delay_s, bandwidth)
    assert np.abs(slip[300:] - slip[-1]).max() < 1e-3
    assert np.abs(slip_after(1.0, bound, 0.0, delay_s, bandwidth)[300:]).max() > 5e-3


def test_the_bound_on_k_s_has_what_is_not_known_of_the_lag() -> None:
    params = load_scenario("paper_planar", law="vic", drive="velocity_125", sensor="ideal").controller
    report = gain_report(params)
    assert report.accepted == pytest.approx(slip_gain_limit(T, latency_s=UNKNOWN_LAG * params.drive_lag_s) / 2.0)
    measured = params.model_copy(update={"slip_estimator": "measured"})
    assert gain_report(measured).accepted < 0.5 * report.accepted
